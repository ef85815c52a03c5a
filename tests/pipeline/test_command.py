"""Limits on the command: what is admissible, and how the solution is brought within it."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import proxcgal as px
from proxcgal import _core

DT = 0.01


@dataclass
class Limits:
    q_min: np.ndarray
    q_max: np.ndarray
    qd_max: np.ndarray
    qdd_max: np.ndarray

    def box(self, q: np.ndarray, qd: np.ndarray, scale: float = 1.0) -> _core.Admissible:
        return _core.admissible(self.q_min, self.q_max, self.qd_max, self.qdd_max, q, qd, DT, scale)


def random_limits(random: np.random.Generator, n: int = 6) -> Limits:
    return Limits(
        -random.uniform(0.5, 3, n),
        random.uniform(0.5, 3, n),
        random.uniform(0.5, 3, n),
        random.uniform(1, 20, n),
    )


def random_tasks(random: np.random.Generator, n: int = 6) -> list[px.Task]:
    return [
        px.Task(random.normal(size=(m, n)), random.normal(size=m), random.uniform(0, 1, m))
        for m in (1, 6, 3)
    ]


def inside(qd: np.ndarray, box: _core.Admissible) -> bool:
    return bool(np.all(qd >= box.low) and np.all(qd <= box.high))


seeds = st.integers(0, 2**32 - 1).map(np.random.default_rng)


@given(seeds)
def test_command_is_admissible_wherever_the_arm_is(random: np.random.Generator) -> None:
    limits, tasks = random_limits(random), random_tasks(random)
    last = random.uniform(-3, 3, 6)
    box = limits.box(random.uniform(-4, 4, 6), last, random.uniform(0, 1))
    solution = px.solve(tasks, limits.qd_max)
    assert inside(_core.command(tasks, solution, last, box), box)
    assert inside(_core.decelerate(last, box), box)


@given(seeds)
def test_a_solution_that_fits_is_the_command(random: np.random.Generator) -> None:
    limits, tasks = random_limits(random), random_tasks(random)
    solution = px.solve(tasks, limits.qd_max)
    box = limits.box(np.zeros(6), solution.qd)
    if inside(solution.qd, box):
        command = _core.command(tasks, solution, solution.qd, box)
        np.testing.assert_array_equal(command, solution.qd)


@settings(max_examples=20)
@given(seeds)
def test_no_limit_is_ever_passed_whatever_is_asked(random: np.random.Generator) -> None:
    limits = random_limits(random)
    q, qd = random.uniform(limits.q_min, limits.q_max), np.zeros(6)
    for tick in range(600):
        if tick % 30 == 0:
            tasks = random_tasks(random)
            solution = px.solve(tasks, limits.qd_max)
        box = limits.box(q, qd, 1.0 if tick % 100 < 70 else 0.4)
        command = _core.command(tasks, solution, qd, box)
        assert np.all(np.abs(command - qd) <= limits.qdd_max * DT + 1e-12)
        assert np.all(np.abs(command) <= limits.qd_max + 1e-12)
        qd, q = command, q + DT * command
        assert np.all(q >= limits.q_min - 1e-12)
        assert np.all(q <= limits.q_max + 1e-12)


@settings(max_examples=30)
@given(seeds)
def test_a_joint_outside_its_limits_only_moves_in(random: np.random.Generator) -> None:
    limits = random_limits(random)
    q, qd = limits.q_max + random.uniform(0, 0.1, 6), np.zeros(6)
    for _ in range(200):
        tasks = random_tasks(random)
        command = _core.command(tasks, px.solve(tasks), qd, limits.box(q, qd))
        was_outside = q > limits.q_max
        assert np.all(command[was_outside] <= 0)
        qd, q = command, q + DT * command


@given(seeds)
def test_braking_from_the_fastest_admissible_speed_ends_at_the_limit(
    random: np.random.Generator,
) -> None:
    a, room = random.uniform(0.5, 20), 10 ** random.uniform(-5, 1)
    top = 1e6
    box = _core.admissible([-1e3], [room], [top], [a], [0.0], [top], DT)
    v, q = box.steady_high[0], 0.0
    while v > 0:
        v, q = v - a * DT, q + v * DT
    assert q == pytest.approx(room, rel=1e-9)


@given(seeds)
def test_with_one_level_the_command_keeps_its_direction_from_rest(
    random: np.random.Generator,
) -> None:
    limits = random_limits(random)
    wish = random.uniform(-3, 3, 6)
    task = px.Task(np.eye(6), wish, np.ones(6))
    box = limits.box(np.zeros(6), np.zeros(6))
    command = _core.command([task], px.solve([task]), np.zeros(6), box)
    np.testing.assert_allclose(np.outer(command, wish), np.outer(wish, command), atol=1e-9)
    at_a_bound = np.isclose(command, box.low) | np.isclose(command, box.high)
    assert np.any(at_a_bound)


@given(seeds)
def test_lower_levels_never_hold_the_top_task_back(random: np.random.Generator) -> None:
    limits = random_limits(random)
    limits.q_min, limits.q_max = np.full(6, -99.0), np.full(6, 99.0)
    row = random.normal(size=(1, 6))
    top = px.Task(row / np.linalg.norm(row), random.normal(size=1), [1.0])
    tasks = [top, *random_tasks(random)[1:]]
    solution = px.solve(tasks, limits.qd_max)
    last = random.uniform(-0.5, 0.5, 6)
    box = limits.box(np.zeros(6), last)
    step = solution.rho[0] - last
    room = np.where(step > 0, box.high - last, last - box.low)
    alone = last + min(1.0, float(np.min(room / np.abs(step)))) * step

    def missing(qd: np.ndarray) -> float:
        return abs(float((top.jacobian @ (solution.qd - qd))[0]))

    command = _core.command(tasks, solution, last, box)
    assert missing(command) <= missing(alone) + 1e-5


@given(seeds)
def test_a_solution_that_stays_is_reached(random: np.random.Generator) -> None:
    limits, tasks = random_limits(random), random_tasks(random)
    limits.q_min, limits.q_max = np.full(6, -99.0), np.full(6, 99.0)
    solution = px.solve(tasks, limits.qd_max)
    qd = random.uniform(-1, 1, 6) * limits.qd_max
    straight = np.max(np.abs(solution.qd - qd) / (limits.qdd_max * DT))
    for _ in range(50 + 10 * int(straight)):
        qd = _core.command(tasks, solution, qd, limits.box(np.zeros(6), qd))
    np.testing.assert_array_equal(qd, solution.qd)


def test_joints_come_to_rest_together() -> None:
    limits = Limits(-9 * np.ones(2), 9 * np.ones(2), 2 * np.ones(2), np.array([10.0, 4.0]))
    qd = np.array([1.5, -0.4])
    for _ in range(15):
        assert qd[1] == pytest.approx(-0.4 / 1.5 * qd[0], abs=1e-12)
        qd = _core.decelerate(qd, limits.box(np.zeros(2), qd))
    np.testing.assert_array_equal(qd, 0)


@given(seeds)
def test_an_approach_is_stopped_wherever_limits_allow(random: np.random.Generator) -> None:
    limits = random_limits(random)
    last = random.uniform(-0.5, 0.5, 6)
    box = limits.box(random.uniform(limits.q_min, limits.q_max), last)
    row = random.normal(size=6)
    qd = _core.keep_rate(row, 0.0, box, random.uniform(box.low, box.high))
    most = np.sum(np.maximum(row * box.low, row * box.high))
    assert inside(qd, box)
    assert row @ qd >= min(0.0, most) - 1e-12


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"q": [np.nan, 0.0]}, px.GeometryError, "q is not finite"),
        ({"qd": [0.0]}, px.GeometryError, r"qd has shape \(1,\), expected \(2,\)"),
        ({"q_max": [1.0]}, px.GeometryError, r"q_max has shape \(1,\), expected \(2,\)"),
        ({"qdd_max": [np.nan, 1.0]}, px.GeometryError, "qdd_max is not finite"),
        ({"qd_max": [-1.0, 1.0]}, px.ConfigError, "qd_max has the value -1, .* at least 0"),
        ({"dt": 0.0}, px.ConfigError, r"dt is 0, must be finite and above 0 s"),
        ({"speed_scale": 2.0}, px.ConfigError, "speed_scale is 2.*between 0 and 1"),
    ],
)
def test_what_is_no_limit_is_told_by_name(
    change: dict[str, object], error: type[Exception], message: str
) -> None:
    good = {
        "q_min": [-1.0, -1.0],
        "q_max": [1.0, 1.0],
        "qd_max": [1.0, 1.0],
        "qdd_max": [1.0, 1.0],
        "q": [0.0, 0.0],
        "qd": [0.0, 0.0],
        "dt": DT,
    }
    with pytest.raises(error, match=message):
        _core.admissible(**(good | change))

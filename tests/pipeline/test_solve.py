"""The task-priority solver against its formulas, written down a second time in numpy."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import proxcgal as px

Level = tuple[np.ndarray, np.ndarray, np.ndarray]  # jacobian, rate, activation
DAMPING, THRESHOLD, ETA = 1e-4, 0.01, 10.0


def inverse(X: np.ndarray, a: np.ndarray, Q: np.ndarray, form: str) -> np.ndarray:
    """X^{#,A,Q} of thesis eq. (4.7)."""
    left = np.eye(X.shape[1]) - Q
    s, V = np.linalg.eigh(X.T @ np.diag(a) @ X + ETA * left.T @ left)
    s = np.maximum(s, 0.0)
    p = np.where(s <= THRESHOLD, DAMPING * (np.cos(np.pi * s / THRESHOLD) + 1) / 2, 0.0)
    f = 1 / (s + p) if form == "literal" else s / (s * s + p)
    return V @ np.diag(f) @ V.T @ X.T @ np.diag(a * a)


def oracle(
    levels: Sequence[Level], qd_max: np.ndarray | None = None, form: str = "literal"
) -> list[np.ndarray]:
    """Thesis eq. (4.8) with its closing level: the velocities after each."""
    n = levels[0][0].shape[1]
    rho, Q, out = np.zeros(n), np.eye(n), []
    for J, rate, a in [*levels, (np.eye(n), np.zeros(n), np.ones(n))]:
        X = J @ Q
        plain = inverse(X, a, np.eye(n), form)
        W = X @ inverse(X, a, Q, form)
        term = Q @ plain @ W @ (rate - J @ rho)
        if qd_max is not None:
            room = np.where(term > 0, qd_max - rho, qd_max + rho)
            moves = np.abs(term) > 1e-10 * (np.abs(term).max() + np.abs(rho).max())
            term = term * max(0.0, min([1.0, *(room[moves] / np.abs(term[moves]))]))
        rho = rho + term
        Q = Q @ (np.eye(n) - plain @ X)
        out.append(rho)
    return out


def solved(
    levels: Sequence[Level], qd_max: np.ndarray | None = None, form: str = "literal"
) -> px.Solution:
    return px.solve([px.Task(*level) for level in levels], qd_max, px.SolverConfig(form=form))


def random_level(random: np.random.Generator, m: int, n: int) -> Level:
    activation = np.clip(random.uniform(-0.5, 1.5, m), 0.0, 1.0)
    return random.normal(size=(m, n)), random.normal(size=m), activation


def random_stack(random: np.random.Generator, kind: str) -> list[Level]:
    n = int(random.integers(2, 9))
    levels = [random_level(random, int(random.integers(1, 9)), n) for _ in range(3)]
    if kind == "deficient":
        levels = [(np.outer(J[:, 0], J[0]), rate, a) for J, rate, a in levels]
        levels[1] = (levels[0][0][:1], levels[1][1][:1], levels[1][2][:1])
    if kind == "scaled":
        scales = [10 ** random.uniform(-3, 2, (J.shape[0], 1)) for J, _, _ in levels]
        levels = [(J * s, rate, a) for (J, rate, a), s in zip(levels, scales, strict=True)]
    return levels


def check_against_oracle(kinds: Sequence[str], count: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    for i in range(count):
        levels = random_stack(random, kinds[i % len(kinds)])
        n = levels[0][0].shape[1]
        form = ("literal", "code")[i // len(kinds) % 2]
        qd_max = random.uniform(0.5, 3.0, n) if i % 3 == 0 else None
        ours, theirs = solved(levels, qd_max, form).rho, oracle(levels, qd_max, form)
        size = 1.0 + max(np.abs(rho).max() for rho in theirs)
        # Eigenvalues are exact to rounding of the largest, and the least that divides is lambda.
        largest = max(np.linalg.norm(J, 2) for J, _, _ in levels)
        tolerance = 1e-9 * (1.0 + largest**2)
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=tolerance * size)


@pytest.mark.parametrize("form", ["literal", "code"])
def test_check_values_of_a_fading_task(form: str) -> None:
    both = [-1.0, -0.44078947, 0.13636364, 0.54532967, 1.0]
    alone = [0.0, 0.03289474, 0.22727273, 0.55631868, 1.0]
    lower = (np.eye(3), np.array([-1, 0.3, 0]), np.ones(3))
    for a, with_lower, without in zip(np.linspace(0, 1, 5), both, alone, strict=True):
        upper = (np.array([[1.0, 0, 0]]), np.ones(1), np.array([a]))
        qd = solved([upper, lower], form=form).qd
        np.testing.assert_allclose(qd, [with_lower, 0.3, 0], rtol=0, atol=1e-7)
        assert solved([upper], form=form).qd[0] == pytest.approx(without, abs=1e-7)


def test_check_values_of_a_badly_scaled_row() -> None:
    upper = (np.array([[0.07, 0, 0]]), np.array([0.2]), np.ones(1))
    lower = (np.eye(3), np.array([-1, 0.3, 0]), np.ones(3))
    assert solved([upper]).qd[0] == pytest.approx(2.79792, abs=1e-5)
    assert solved([upper, lower]).qd[0] == pytest.approx(2.79792, abs=1e-5)
    assert solved([upper], form="code").qd[0] == pytest.approx(0.197, abs=5e-4)
    assert solved([upper, lower], form="code").qd[0] == pytest.approx(-0.118, abs=5e-4)


def test_agrees_with_the_formulas_on_random_stacks() -> None:
    check_against_oracle(["plain", "deficient", "scaled"], 2000, seed=1)


@pytest.mark.long
def test_agrees_with_the_formulas_on_a_hundred_thousand_stacks() -> None:
    check_against_oracle(["plain", "deficient", "scaled"], 100_000, seed=2)


def check_first_level(count: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    checked = 0
    while checked < count:
        n = int(random.integers(2, 9))
        J, rate, _ = random_level(random, int(random.integers(1, 9)), n)
        if random.random() < 0.3:
            J[-1] = J[0]  # contradicts the first row: no velocity serves both
        a = (random.random(J.shape[0]) < 0.7).astype(float)
        active = J[a > 0]
        singular = np.linalg.svd(active, compute_uv=False)
        if not len(singular) or np.any((singular > 1e-9) & (singular < 0.1)):
            continue
        checked += 1
        best = active @ np.linalg.lstsq(active, rate[a > 0], rcond=1e-9)[0] - rate[a > 0]
        lower = [random_level(random, 6, n), random_level(random, 3, n)]
        kept = active @ solved([(J, rate, a), *lower]).qd - rate[a > 0]
        size = 1.0 + max(np.abs(level[1]).max() for level in lower)
        assert np.linalg.norm(kept) <= np.linalg.norm(best) + 1e-8 * size


def test_first_level_keeps_its_optimum_where_no_singular_value_is_small() -> None:
    check_first_level(2000, seed=3)


@pytest.mark.long
def test_first_level_keeps_its_optimum_on_a_hundred_thousand_stacks() -> None:
    check_first_level(100_000, seed=4)


seeds = st.integers(0, 2**32 - 1).map(np.random.default_rng)


@given(seeds, st.integers(0, 2))
def test_a_task_with_activation_0_might_as_well_not_be_there(
    random: np.random.Generator, position: int
) -> None:
    levels = random_stack(random, "plain")
    J, rate, _ = levels.pop(position)
    inactive = (J, rate, np.zeros(len(rate)))
    with_it = solved([*levels[:position], inactive, *levels[position:]]).qd
    np.testing.assert_array_equal(with_it, solved(levels).qd)


@given(seeds, st.sampled_from([0.0, 1e-3, 0.1, 0.5, 0.9, 1.0 - 1e-6]))
def test_is_continuous_in_the_activation(random: np.random.Generator, activation: float) -> None:
    n = 6
    J = random.normal(size=(1, n))
    upper = (J / np.linalg.norm(J), random.normal(size=1), np.array([activation]))
    nearly = (upper[0], upper[1], np.array([activation + 1e-6]))
    # Well-conditioned rows: at a singular value of the damping's width the slope is its inverse.
    Q, _ = np.linalg.qr(random.normal(size=(n, n)))
    lower = (Q[:3], random.normal(size=3), np.ones(3))
    change = solved([nearly, lower]).qd - solved([upper, lower]).qd
    assert np.linalg.norm(change) < 1e-3


@given(seeds)
def test_activation_1_is_plain_priority(random: np.random.Generator) -> None:
    Q, _ = np.linalg.qr(random.normal(size=(7, 7)))
    first, second = Q[:2], Q[1:5]  # they share a row, on which the first one wins
    rates = random.normal(size=2), random.normal(size=4)
    qd = solved([(first, rates[0], np.ones(2)), (second, rates[1], np.ones(4))]).qd
    wished = np.array([*rates[0], *rates[1][1:], 0, 0])
    np.testing.assert_allclose(Q @ qd, wished, rtol=0, atol=1e-9)


@given(seeds)
def test_each_level_stays_within_the_speed_limits(random: np.random.Generator) -> None:
    levels = [(J * 0.1, rate * 10, a) for J, rate, a in random_stack(random, "scaled")]
    qd_max = random.uniform(0.0, 2.0, levels[0][0].shape[1])
    for rho in solved(levels, qd_max).rho:
        assert np.all(np.abs(rho) <= qd_max)


@given(seeds)
def test_saturation_keeps_the_direction(random: np.random.Generator) -> None:
    level = random_level(random, 4, 6)
    free, held = solved([level]).rho[0], solved([level], np.full(6, 0.1)).rho[0]
    cross = np.outer(free, held)
    np.testing.assert_allclose(cross, cross.T, atol=1e-12)
    assert free @ held >= 0


extreme = st.floats(allow_nan=False, allow_infinity=False)


@settings(max_examples=300)
@given(st.data(), st.sampled_from(["literal", "code"]))
def test_is_finite_for_any_finite_input(data: st.DataObject, form: str) -> None:
    levels = []
    for m in (1, 3):
        values = data.draw(st.lists(extreme, min_size=m * 4, max_size=m * 4))
        a = data.draw(st.lists(st.floats(0, 1), min_size=m, max_size=m))
        numbers = np.array(values).reshape(m, 4)
        levels.append((numbers[:, :3], numbers[:, 3], np.array(a)))
    for qd_max in (None, np.ones(3)):
        solution = solved(levels, qd_max, form)
        assert np.all(np.isfinite(solution.rho))
        assert 0 <= solution.overflowed <= 3


def test_each_task_leaves_its_velocity() -> None:
    levels = [random_level(np.random.default_rng(5), 2, 6) for _ in range(3)]
    solution = solved(levels)
    assert len(solution.rho) == 4
    np.testing.assert_array_equal(solution.rho[-1], solution.qd)


GOOD = ([[1.0, 0.0]], [1.0], [1.0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([1.0, 0.0], [1.0], [1.0]), r"jacobian has shape \(2,\), expected \(m, n\)"),
        (([[1.0, 0.0]], [1.0, 2.0], [1.0]), r"rate has shape \(2,\), expected \(1,\)"),
        (([[1.0, 0.0]], [1.0], [[1.0]]), r"activation has shape \(1, 1\), expected \(1,\)"),
        (([[np.nan, 0.0]], [1.0], [1.0]), "jacobian is not finite"),
        (([[1.0, 0.0]], [np.inf], [1.0]), "rate is not finite"),
        (([[1.0, 0.0]], [1.0], [np.nan]), "activation is not finite"),
        (("row", [1.0], [1.0]), "jacobian is .*str.*, expected"),
        ((np.zeros((1, 0)), [1.0], [1.0]), "jacobian has no column"),
    ],
)
def test_an_array_that_is_no_task_is_told_by_name(
    arguments: tuple[object, object, object], message: str
) -> None:
    with pytest.raises(px.GeometryError, match=message):
        px.Task(*arguments)


def test_an_activation_outside_its_bounds_is_told() -> None:
    with pytest.raises(px.ConfigError, match=r"activation has the value 1\.5, must be between 0"):
        px.Task([[1.0, 0.0]], [1.0], [1.5])


def test_limits_of_size_are_told() -> None:
    with pytest.raises(px.ConfigError, match="33 rows of jacobian: at most 32"):
        px.Task(np.zeros((33, 2)), np.zeros(33), np.zeros(33))
    with pytest.raises(px.ConfigError, match="33 columns of jacobian: at most 32"):
        px.Task(np.zeros((1, 33)), [0.0], [0.0])
    with pytest.raises(px.ConfigError, match="17 tasks: at most 16"):
        px.solve([px.Task(*GOOD)] * 17)
    px.solve([px.Task(np.eye(32), np.ones(32), np.ones(32))] * 16)


def test_a_stack_that_does_not_fit_is_told() -> None:
    task = px.Task(*GOOD)
    with pytest.raises(px.ConfigError, match="tasks is empty"):
        px.solve([])
    with pytest.raises(px.GeometryError, match=r"tasks\[1\]\.jacobian has 3 columns, expected 2"):
        px.solve([task, px.Task([[1.0, 0, 0]], [1.0], [1.0])])
    with pytest.raises(px.GeometryError, match=r"qd_max has shape \(3,\), expected \(2,\)"):
        px.solve([task], [1.0, 1.0, 1.0])
    with pytest.raises(px.GeometryError, match="qd_max is not finite"):
        px.solve([task], [np.nan, 1.0])
    with pytest.raises(px.ConfigError, match=r"qd_max has the value -1, must be at least 0"):
        px.solve([task], [-1.0, 1.0])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: px.SolverConfig(damping=-1), r"SolverConfig\.damping is -1, must be finite"),
        (lambda: px.SolverConfig(damping_threshold=0), "damping_threshold is 0, .*above 0"),
        (lambda: px.SolverConfig(eta=np.inf), "eta is inf, must be finite"),
        (lambda: px.SolverConfig(form="svd"), "form is 'svd', must be one of 'literal', 'code'"),
        (lambda: px.Avoidance(d_min=-0.1), r"Avoidance\.d_min is -0\.1 m, .*at least 0 m"),
        (lambda: px.Avoidance(nearest=0), r"Avoidance\.nearest is 0, must be between 1 and 32"),
        (lambda: px.Reach(max_linear=0), r"Reach\.max_linear is 0 m/s, must be finite and above 0"),
        (lambda: px.JointLimits(margin=-1), r"JointLimits\.margin is -1 rad or m, must be finite"),
        (lambda: px.MinimumAltitude(height=np.nan), r"MinimumAltitude\.height is nan m, .*finite"),
        (lambda: px.Manipulability(low=0.2), r"Manipulability\.high is 0\.05, .*above low"),
        (lambda: px.Manipulability(joints=5), r"Manipulability\.joints is 5, .*between 6 and 32"),
    ],
)
def test_a_setting_out_of_bounds_is_told(make: object, message: str) -> None:
    with pytest.raises(px.ConfigError, match=message):
        make()  # type: ignore[operator]


def test_a_setting_changed_to_nonsense_is_told_when_used() -> None:
    config = px.SolverConfig()
    config.damping = -1.0
    with pytest.raises(px.ConfigError, match="damping"):
        px.solve([px.Task(*GOOD)], config=config)

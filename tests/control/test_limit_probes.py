"""Beside an obstacle the arm gets away, out and to rest: short forms of bench/limit_probes.py."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import proxcgal as px

SCRIPT = Path(__file__).parents[2] / "bench" / "limit_probes.py"


@pytest.fixture(scope="module")
def probes() -> ModuleType:
    spec = importlib.util.spec_from_file_location("limit_probes", SCRIPT)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules["limit_probes"] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("nearest", [1, 3])
def test_from_a_point_10_mm_away_the_arm_gets_as_far_as_its_joints_can(
    probes: ModuleType, ur10e: px.Robot, nearest: int
) -> None:
    tasks = [px.Avoidance(nearest=nearest), px.Reach()]
    for q, point_W, link in probes.beside(ur10e, 3, 11, lambda _random: 0.010):
        best = probes.best_distance(ur10e, q, point_W, 3.0)
        run = probes.drive(ur10e, q, lambda _t, p=point_W: p[None], tasks=tasks)
        assert run.distances[-1] >= min(probes.REACHABLE, best - 0.02), link
        assert run.fastest_near <= 0.05
        assert run.modes == {"RUN"}


@pytest.mark.parametrize("nearest", [1, 3])
def test_from_a_point_inside_a_link_the_arm_gets_out(
    probes: ModuleType, ur10e: px.Robot, nearest: int
) -> None:
    tasks = [px.Avoidance(nearest=nearest), px.Reach()]
    for q, point_W, link in probes.beside(ur10e, 2, 12, lambda r: -r.uniform(0.006, 0.015)):
        run = probes.drive(ur10e, q, lambda _t, p=point_W: p[None], seconds=2.5, tasks=tasks)
        assert run.distances[-1] > 0.0, link


def test_a_ball_that_stops_beside_a_link_is_left_not_kept(
    probes: ModuleType, ur10e: px.Robot
) -> None:
    for q, point_W, link in probes.beside(ur10e, 2, 13, lambda r: r.uniform(0.005, 0.030)):
        away = px.signed_distance(ur10e, q, point_W[None]).normal_W[0]

        def at(time: float, end: np.ndarray = point_W, out: np.ndarray = away) -> np.ndarray:
            return (end + max(0.0, 1.0 - 0.8 * time) * out)[None]

        best = probes.best_distance(ur10e, q, point_W, 3.0)
        run = probes.drive(ur10e, q, at, seconds=4.5)
        assert run.distances[-1] >= min(probes.REACHABLE, best - 0.02), link
        assert "HOLD" not in run.modes


def test_a_goal_of_nan_never_pins_the_arm(probes: ModuleType, ur10e: px.Robot) -> None:
    goal = np.full((4, 4), np.nan)
    for q, point_W, link in probes.beside(ur10e, 2, 14, lambda _random: 0.09):
        best = probes.best_distance(ur10e, q, point_W, 3.0)
        run = probes.drive(ur10e, q, lambda _t, p=point_W: p[None], goal=goal)
        assert run.modes == {"HOLD"}
        assert run.distances[-1] >= min(probes.REACHABLE, best - 0.02), link


def test_an_arm_that_does_not_follow_is_found_and_only_braked(ur10e: px.Robot) -> None:
    ctrl = px.Controller(ur10e, px.Skin([]))
    q = np.array([0.0, -1.9, 2.8, -2.47, -1.57, 0.0])
    goal = ur10e.tool_pose(q)
    goal[0, 3] += 0.3
    off, found = 0.5, None
    for i in range(90):
        time = 0.01 * i
        out = ctrl.tick_known(time, q, np.full((1, 3), 9.0), goal)
        reasons = {f.reason for f in out.findings}
        assert "not_following" not in reasons or time >= off
        if "not_following" in reasons and found is None:
            found = time
        assert found is None or out.mode == px.Mode.HOLD
        if time < off:  # then the drives are off
            q = q + 0.01 * out.qd
    assert found is not None
    assert found - off <= 0.1
    assert np.linalg.norm(out.qd) == 0.0


def test_a_joint_state_in_degrees_stops_the_arm(ur10e: px.Robot) -> None:
    ctrl = px.Controller(ur10e, px.Skin([]))
    q = np.degrees([0.0, -1.9, 2.8, -2.47, -1.57, 0.0])
    out = ctrl.tick_known(0.0, q, np.zeros((0, 3)), np.eye(4))
    assert out.mode == px.Mode.STOP
    assert [f.reason for f in out.findings] == ["joint_state_units"]


def test_three_holds_of_one_cause_hold_the_arm_off_until_reset(ur10e: px.Robot) -> None:
    ctrl = px.Controller(ur10e, px.Skin([]))
    q = np.array([0.0, -1.9, 2.8, -2.47, -1.57, 0.0])
    goal, bad = ur10e.tool_pose(q), np.full((4, 4), np.nan)
    none = np.zeros((0, 3))
    modes = []
    for i in range(300):  # a goal of NaN every 0.8 s
        out = ctrl.tick_known(0.01 * i, q, none, bad if i % 80 == 0 else goal)
        modes.append(out.mode)
    assert px.Mode.RUN in modes[60:80]
    assert set(modes[165:]) == {px.Mode.HOLD}
    assert [f.reason for f in out.findings] == ["held_off"]
    assert ctrl.reset()
    for i in range(300, 360):
        out = ctrl.tick_known(0.01 * i, q, none, goal)
    assert out.mode == px.Mode.RUN


def test_a_slow_loop_is_found(ur10e: px.Robot) -> None:
    ctrl = px.Controller(ur10e, px.Skin([]))
    q = np.array([0.0, -1.9, 2.8, -2.47, -1.57, 0.0])
    for period, slow in ((0.01, False), (0.015, True)):
        for i in range(100):
            out = ctrl.tick_known(period * (i + (period > 0.01) * 100), q, np.zeros((0, 3)),
                                  ur10e.tool_pose(q))  # fmt: skip
        assert ("loop_slow" in {f.reason for f in out.findings}) == slow


def test_an_arm_asked_to_a_gain_that_rings_is_refused_with_the_numbers(ur10e: px.Robot) -> None:
    limit = px.LimitConfig(dead_time=0.05, lag=0.08)
    with pytest.raises(px.ConfigError, match=r"1/e = 0\.368: gain 4.* 1/s, delay 0\.14"):
        px.Controller(
            ur10e, px.Skin([]),
            px.ControllerConfig(tasks=[px.Avoidance(gain=4.0), px.Reach()], limit=limit),
        )  # fmt: skip

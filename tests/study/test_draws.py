"""Random scenes meet what is promised of them, and medians come with the right intervals."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

import proxcgal as px
from proxcgal.evaluation.ground_truth import GroundTruth
from proxcgal.scenario.loading import load_scenario
from proxcgal.study.bootstrap import Interval, mean_interval, median_interval
from proxcgal.study.static.draws import crosses, draw_scene, reachable


def test_draws_meet_what_is_promised_of_them() -> None:
    base = load_scenario("front_plane")
    robot = px.load_robot("ur10e")
    redrawn = 0
    for number in range(12):
        draw = draw_scene(base, robot, 7, number)
        redrawn += draw.redrawn.total()
        scenario, panel = draw.scenario, draw.scenario.obstacles[0]
        true = GroundTruth(robot, scenario.scene())(np.array(scenario.q0))
        assert true.distance >= 0.3
        assert true.own >= 0.03
        np.testing.assert_array_less(
            np.abs(np.subtract(panel.position, base.obstacles[0].position)), 0.1001
        )
        assert np.abs(panel.rpy).max() < 0.2601
        assert np.abs(np.subtract(scenario.q0, base.q0)).max() < 0.2001
        again = draw_scene(base, robot, 7, number)
        assert again.overrides == draw.overrides
    assert redrawn > 0


def test_a_goal_is_within_reach_where_a_posture_reaches_it() -> None:
    robot = px.load_robot("ur10e")
    q0 = np.array(load_scenario("front_plane").q0)
    generator = np.random.default_rng(5)
    for _ in range(5):
        assert reachable(robot, q0, robot.tool_pose(q0 + generator.uniform(-0.6, 0.6, 6)))
    far = np.array(robot.tool_pose(q0))
    far[:3, 3] = (1.5, 0.0, 0.6)
    assert not reachable(robot, q0, far)


def test_a_line_crosses_a_plate_or_passes_it() -> None:
    T_WO = np.eye(4)
    T_WO[:3, 3] = (1.0, 0.0, 0.0)
    size = (0.02, 1.0, 1.0)
    crossing = np.array([0.0, 0.0, 0.0]), np.array([2.0, 0.8, 0.0])
    passing = np.array([0.0, 0.0, 0.0]), np.array([2.0, 1.2, 0.0])
    before = np.array([0.0, 0.0, 0.0]), np.array([0.9, 0.0, 0.0])
    assert crosses(size, T_WO, *crossing)
    assert not crosses(size, T_WO, *passing)
    assert not crosses(size, T_WO, *before)


@pytest.mark.parametrize(("of", "middle"), [(median_interval, np.median), (mean_interval, np.mean)])
def test_intervals_are_those_of_scipy(
    of: Callable[..., Interval | None], middle: Callable[..., float]
) -> None:
    values = np.random.default_rng(4).normal(100.0, 30.0, 80).tolist()
    interval = of(values)
    assert interval is not None
    assert interval.middle == middle(values)
    oracle = stats.bootstrap(
        (values,), middle, method="percentile", n_resamples=10_000, rng=1
    ).confidence_interval
    assert interval.low == pytest.approx(oracle.low, abs=2.0)
    assert interval.high == pytest.approx(oracle.high, abs=2.0)
    assert of([]) is None

"""Other values for a controller's tasks, while it runs."""

import numpy as np
import pytest

import proxcgal as px

Q = np.array([0.0, -1.9, 2.8, -2.47, -1.57, 0.0])


@pytest.fixture(scope="module")
def robot() -> px.Robot:
    return px.load_robot("ur10e")


def controller(robot: px.Robot, d_min: float) -> px.Controller:
    tasks = [px.Avoidance(d_min=d_min), px.Reach()]
    return px.Controller(robot, px.Skin([], px.SensorModel()), px.ControllerConfig(tasks=tasks))


def ahead(robot: px.Robot) -> tuple[np.ndarray, np.ndarray]:
    """A goal beyond a point that stands 0.3 m before the tool."""
    goal = np.array(robot.tool_pose(Q))
    point_W = goal[:3, 3] + [0.3, 0.0, 0.0]
    goal[0, 3] += 0.6
    return goal, point_W.reshape(1, 3)


def test_retuned_tasks_act_as_those_made_so_and_the_commands_go_on(robot: px.Robot) -> None:
    goal, points_W = ahead(robot)
    changed, fresh = controller(robot, 0.1), controller(robot, 0.25)
    for tick in range(5):
        before = changed.tick_known(0.01 * tick, Q, points_W, goal)
        fresh.tick_known(0.01 * tick, Q, points_W, goal)
    changed.retune([px.Avoidance(d_min=0.25), px.Reach()])
    assert changed.config.tasks[0].d_min == 0.25
    after = changed.tick_known(0.05, Q, points_W, goal)
    wanted = fresh.tick_known(0.05, Q, points_W, goal)
    assert after.tasks[0].rate == pytest.approx(wanted.tasks[0].rate)
    assert after.tasks[0].activation[0] > before.tasks[0].activation[0]
    # What was commanded stays: the change keeps to the acceleration limits.
    assert np.all(np.abs(after.qd - before.qd) <= robot.qdd_max * 0.01 + 1e-12)


def test_a_stop_outlasts_a_change(robot: px.Robot) -> None:
    goal, points_W = ahead(robot)
    ctrl = controller(robot, 0.1)
    ctrl.tick_known(0.0, np.full(6, np.nan), points_W, goal)
    ctrl.retune([px.Avoidance(d_min=0.25), px.Reach()])
    assert ctrl.tick_known(0.01, Q, points_W, goal).mode == px.Mode.STOP


def test_other_tasks_or_values_out_of_bounds_change_nothing(robot: px.Robot) -> None:
    ctrl = controller(robot, 0.1)
    wrong = px.Avoidance()
    wrong.d_min = -1.0
    for tasks, told in (
        ([px.Reach(), px.Avoidance()], "same order: avoidance, reach"),
        ([px.Avoidance()], "same order: avoidance, reach"),
        ([wrong, px.Reach()], "d_min"),
    ):
        with pytest.raises(px.ConfigError, match=told):
            ctrl.retune(tasks)
    assert ctrl.config.tasks[0].d_min == 0.1


def test_the_pairs_that_self_collision_watches_stay(robot: px.Robot) -> None:
    def tasks(**values: object) -> list[object]:
        return [px.Avoidance(), px.SelfCollision(**values), px.Reach()]

    ctrl = px.Controller(
        robot, px.Skin([], px.SensorModel()), px.ControllerConfig(tasks=tasks(d_min=0.05))
    )
    ctrl.retune(tasks(d_min=0.06))
    assert ctrl.config.tasks[1].d_min == 0.06
    with pytest.raises(px.ConfigError, match=r"self_collision\.pairs: are chosen at set-up"):
        ctrl.retune(tasks(d_min=0.07, pairs=[("forearm_link", "base_link")]))
    assert ctrl.config.tasks[1].d_min == 0.06

"""Finds the task that blocks progress, its link, and the obstacle."""

from dataclasses import replace
from typing import Any

import numpy as np

from proxcgal.core.modes import HOLD
from proxcgal.core.transforms import inverse, pose_errors, sine_axis
from proxcgal.core.typing import Array
from proxcgal.evaluation.termination import Ending, StallCause
from proxcgal.scenario.setup import Setup
from proxcgal.sim.tick import TickResult

_SETTLED = 80  # ticks at one posture after which a command has reached what it wants
_FREES = 0.01  # [m/s] or [rad/s] towards the goal: less is no way out


def stall_cause(
    setup: Setup, q: Array, points_W: Array, last: TickResult, time: float
) -> StallCause:
    """Leaves each task out in turn: the one that frees most of the way to the goal holds the arm.

    Every variant is asked at the same posture and on the same points, until its command has come
    to rest; what counts is how much faster the tool then goes towards the goal.

    Args:
        setup: of the run.
        q: (n_q,) where the arm stands.
        points_W: (n, 3) what the controller was given, or saw, last [m].
        last: the run's last tick, which knows the sensor's zone.
        time: when that was [s].
    """
    goal = setup.goal
    levels = setup.scenario.controller.levels
    before, out = _towards(setup, q, goal, points_W)
    freed: dict[str, float] = {
        task: _towards(_without(setup, task), q, goal, points_W)[0] - before
        for task in levels
        if task != "reach" and len(levels) > 1
    }
    task = max(freed, key=lambda name: freed[name], default="")
    if not task or freed[task] < _FREES:
        return StallCause()
    found = StallCause(task=task, freed=freed[task])
    if task == "avoidance":
        return replace(
            found, link=out.control_link, obstacle=_nearest_obstacle(setup, out, time),
            sensor=last.sensor, zone=last.zone,
        )  # fmt: skip
    if task == "self_collision" and out.own_links is not None:
        return replace(found, link=out.own_links[0], obstacle=out.own_links[1])
    if task == "joint_limits":
        row = int(np.argmax(out.tasks[levels.index(task)].activation))
        return replace(found, link=setup.robot.joint_names[row])
    return replace(found, link=setup.robot.tool)


def concluded(
    setup: Setup, ending: Ending, last: TickResult, q: Array, points_W: Array, time: float
) -> Ending:
    """The ending with what held the arm and how far it still was, where it did not succeed.

    Args:
        setup: of the run.
        ending: without what held the arm.
        last: of the run's ticks.
        q: (n_q,) where the arm really stands, whatever a fault reports.
        points_W: (n, 3) what the controller was given, or saw, last [m].
        time: of the scene, at that tick [s].
    """
    if ending.outcome == "succeeded":
        return ending
    holding = stall_cause(setup, q, points_W, last, time)
    metres, radians = pose_errors(np.asarray(setup.robot.tool_pose(q)), setup.goal)
    words = [f"{holding}", f"{ending.reason}, {metres:.3f} m and {radians:.3f} rad remain"]
    if last.mode >= HOLD:
        found = ", ".join(sorted({finding.reason for finding in last.findings}))
        words.insert(1, f"the monitor holds the arm: {found or 'it is not clear yet'}")
    return replace(ending, reason="; ".join(words), holding=holding)


def _without(setup: Setup, task: str) -> Setup:
    settings = setup.scenario.controller
    left = tuple(name for name in settings.levels if name != task)
    settings = settings.model_copy(update={"tasks": left, "off": ()})
    return replace(setup, scenario=setup.scenario.model_copy(update={"controller": settings}))


def _towards(setup: Setup, q: Array, goal: Array, points_W: Array) -> tuple[float, Any]:
    """How fast the tool would go towards the goal, and the controller's last answer."""
    settings = setup.make_controller("wb_known", len(points_W))
    points_W = np.ascontiguousarray(points_W, np.float64)
    for tick in range(_SETTLED):
        out = settings.tick_known(tick * settings.config.period, q, points_W, goal)
    velocity = setup.robot.tool_jacobian(q) @ out.qd
    T_WT = np.asarray(setup.robot.tool_pose(q))
    ahead_W = goal[:3, 3] - T_WT[:3, 3]
    finish = setup.scenario.ends()
    error = pose_errors(T_WT, goal)
    if finish is not None and error[0] <= finish.position:  # the turn is what is missing
        axis = 2.0 * sine_axis(goal[:3, :3] @ T_WT[:3, :3].T)
        return float(velocity[3:] @ axis / max(float(np.linalg.norm(axis)), 1e-9)), out
    return float(velocity[:3] @ ahead_W / max(error[0], 1e-9)), out


def _nearest_obstacle(setup: Setup, out: Any, time: float) -> str:
    """Name of the one that the pair's obstacle point is on; "" for none."""
    if out.pair is None or not setup.scene.names:
        return ""
    point_W = np.asarray(out.pair.obstacle_W)
    scene = setup.scene

    def distance(row: int) -> float:
        point_O = (inverse(scene.poses(time)[row]) @ [*point_W, 1.0])[:3]
        return float(np.linalg.norm(point_O - scene.solids[row].nearest(point_O)))

    return scene.names[min(range(len(scene.names)), key=distance)]

"""Goals of the 12-joint robot: what they say, where they lead, what is wrong with them.

Source: [JR] 3.2.1 and 4.1.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from proxcgal.core import transforms
from proxcgal.core.errors import ProxError
from proxcgal.core.typing import Array
from proxcgal.evaluation.termination import Outcome
from proxcgal.models.robots import Robot
from proxcgal.scenario.setup import posture_problems

State = Literal["starting", "executing", "cancelling", "succeeded", "aborted", "cancelled"]

BASE, END_EFFECTOR = FRAMES = ("kuka_base", "end_effector")
AT_REST = 1e-3  # [rad/s] of every joint
STOPPED_AFTER = 3.0  # [s] a cancelled goal has ended, whatever still moves the arm
KEPT_RESULTS = 1000  # the oldest are forgotten


class GoalRefusedError(ProxError):
    """A goal that is not taken on, with every reason; nothing has moved."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JointGoal:
    """Where the tool is to go, as [JR] 3.2.1 and 4.1 have it."""

    translation: Sequence[float]  # [m] (3,) r of (4.1)
    rpy: Sequence[float] | None = None  # [rad] roll, pitch, yaw; None: orientation kept
    frame: str = BASE  # that both are given in: kuka_base or end_effector
    init: str = ""  # configuration to begin from; "": where the arm stands


@dataclass(frozen=True, slots=True)
class GoalFeedback:
    """How a goal is doing."""

    goal: int
    state: State
    time_s: float  # since it was taken on
    linvel_norm: float  # [m/s] of the tool
    angvel_norm: float  # [rad/s]
    position_error_m: float
    angle_error_rad: float


@dataclass(frozen=True, slots=True)
class GoalResult:
    """How a goal ended."""

    goal: int
    outcome: Outcome
    reason: str
    time_s: float
    position_error_m: float
    angle_error_rad: float


def problems_of(
    goal: JointGoal, robot: Robot, configurations: Mapping[str, Sequence[float]]
) -> list[str]:
    """What is wrong with a goal in itself, a line each; where it leads is not looked at.

    Args:
        goal: from anybody.
        robot: whose joint limits hold.
        configurations: to begin from, by name.
    """
    wrong = (
        _three("translation", goal.translation),
        None if goal.rpy is None else _three("rpy", goal.rpy),
    )
    problems = [problem for problem in wrong if problem is not None]
    if goal.frame not in FRAMES:
        problems.append(f"frame = {goal.frame!r}: must be one of {', '.join(FRAMES)}")
    if goal.init:
        q = configurations.get(goal.init) if isinstance(goal.init, str) else None
        outside = (
            [f"there are {', '.join(configurations)}"]
            if q is None
            else posture_problems(robot, q, goal.init)
        )
        problems += [f"init = {goal.init!r}: {line}" for line in outside]
    return problems


def goal_pose(goal: JointGoal, T_WE: Array) -> Array:
    """(4, 4) T_WT of a goal, the tool being at T_WE; any frame but end_effector is the base.

    Source: [JR] (4.2) to (4.6); (4.6) forgets to rotate, so here it is r_ee + R_ee r_goal.
    """
    T_WT = np.eye(4)
    turn = None if goal.rpy is None else transforms.rotation_from_rpy(goal.rpy)  # (4.2)
    if goal.frame == END_EFFECTOR:
        T_WT[:3, :3] = T_WE[:3, :3] if turn is None else T_WE[:3, :3] @ turn  # (4.4)
        T_WT[:3, 3] = T_WE[:3, 3] + T_WE[:3, :3] @ np.asarray(goal.translation)  # (4.6), corrected
    else:
        T_WT[:3, :3] = T_WE[:3, :3] if turn is None else turn  # (4.3)
        T_WT[:3, 3] = goal.translation  # (4.5)
    return T_WT


def reach_of(robot: Robot) -> tuple[Array, float]:
    """A point (3,) and the radius that the tool never leaves: the sum of all lengths after it."""
    joints, frame = robot.description.joints, robot.description.tool_frame
    length, row = float(np.linalg.norm(frame.T_JF[:3, 3])), frame.joint
    while row >= 0 and joints[row].parent >= 0:
        length += float(np.linalg.norm(joints[row].origin[:3, 3]))
        if joints[row].type == "prismatic":
            length += max(abs(joints[row].q_min), abs(joints[row].q_max))
        row = joints[row].parent
    return (np.zeros(3) if row < 0 else np.asarray(joints[row].origin)[:3, 3]), length


def reach_problem(reach: tuple[Array, float], T_WT: Array) -> str | None:
    """Why no posture brings the tool there; None where one may.

    Args:
        reach: of the robot, see `reach_of`.
        T_WT: (4, 4) of the goal.
    """
    base_W, farthest = reach
    with np.errstate(over="ignore"):
        far = float(np.linalg.norm(T_WT[:3, 3] - base_W))
    if far <= farthest:
        return None
    x, y, z = T_WT[:3, 3]
    return (
        f"translation: the tool would be at ({x:.6g}, {y:.6g}, {z:.6g}) m, {far:.6g} m "
        f"from the first joint; no posture reaches beyond {farthest:.3f} m"
    )


def _short_text(values: object) -> str:
    try:
        return str(values)[:80]
    except ValueError:  # Python does not write integers of so many digits
        return "?"


def _three(name: str, values: object) -> str | None:
    """Why these are not three finite numbers; None where they are."""
    try:
        if (
            not isinstance(values, Sequence | np.ndarray)
            or len(values) != 3
            or any(isinstance(value, bool | str) for value in values)
        ):
            raise TypeError
        finite = all(math.isfinite(value) for value in values)
    except (TypeError, OverflowError):
        return f"{name} = {_short_text(values)}: must be three finite numbers"
    return None if finite else f"{name} = {list(values)}: must be finite"

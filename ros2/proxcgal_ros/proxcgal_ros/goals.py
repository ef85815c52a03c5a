"""Goals of MoveRobot, whoever pursues them: what they are, how they are told, how they end."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from proxcgal.errors import ProxError
from proxcgal.models import Robot
from proxcgal.sim import frames

Array = NDArray[np.float64]
Outcome = Literal["succeeded", "aborted", "cancelled"]

END_EFFECTOR = "end_effector"
BASE = "kuka_base"  # the thesis's name for the base of the chain, whatever robot that is


class GoalRefusedError(ProxError):
    """A goal that is not taken on, with every reason on a line; nothing has moved."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """Where the tool is to go. Source: [JR] 3.2.1 and 4.1."""

    translation: Sequence[float]  #: [m] (3,) r of (4.1)
    rpy: Sequence[float] | None = None  #: [rad] roll, pitch, yaw; None: orientation kept
    frame: str = BASE  #: that both are given in
    init: str = ""  #: configuration to begin from; "": where the arm stands


@dataclass(frozen=True, slots=True)
class Feedback:
    """How a goal is doing."""

    state: str  #: starting, executing, cancelling
    time_s: float  #: since it was taken on
    linvel_norm: float  #: [m/s] of the tool
    angvel_norm: float  #: [rad/s]
    position_error_m: float
    angle_error_rad: float


@dataclass(frozen=True, slots=True)
class Result:
    """How a goal ended."""

    outcome: Outcome
    reason: str
    time_s: float
    position_error_m: float
    angle_error_rad: float


class GoalServer(Protocol):
    """Whoever takes goals: every goal that it takes ends exactly once."""

    def send_goal(self, goal: Goal) -> int:
        """Its number. Raises: GoalRefusedError."""

    def cancel(self, number: int) -> bool:
        """False where it has ended already."""

    def feedback(self, number: int) -> Feedback | None:
        """None where it is not pursued."""

    def result(self, number: int) -> Result | None:
        """None while it has not ended."""


def goal_pose(goal: Goal, T_WE: Array) -> Array:
    """(4, 4) T_WT of a goal, the tool being at T_WE.

    Source: [JR] (4.2) to (4.6); (4.6) forgets to rotate, so here it is r_ee + R_ee r_goal.
    """
    T_WT = np.eye(4)
    turn = None if goal.rpy is None else frames.rotation(goal.rpy)  # (4.2)
    if goal.frame == END_EFFECTOR:
        T_WT[:3, :3] = T_WE[:3, :3] if turn is None else T_WE[:3, :3] @ turn  # (4.4)
        T_WT[:3, 3] = T_WE[:3, 3] + T_WE[:3, :3] @ np.asarray(goal.translation)  # (4.6), mended
    else:
        T_WT[:3, :3] = T_WE[:3, :3] if turn is None else turn  # (4.3)
        T_WT[:3, 3] = goal.translation  # (4.5)
    return T_WT


def goal_problems(goal: Goal, base_frames: Sequence[str]) -> list[str]:
    """What is wrong with a goal before anything of the robot is looked at, a line each."""
    problems = [
        f"{name} = {list(values)}: must be finite"
        for name, values in (("translation", goal.translation), ("rotation", goal.rpy or ()))
        if not all(math.isfinite(value) for value in values)
    ]
    allowed = (*dict.fromkeys(base_frames), END_EFFECTOR)
    if goal.frame not in allowed:
        problems.append(f"frame = {goal.frame!r}: must be one of {', '.join(allowed)}")
    return problems


def reach_problem(robot: Robot, T_WT: Array) -> str | None:
    """Is this farther than the arm is long?"""
    joints, tool = robot.description.joints, robot.description.tool_frame
    length, row = float(np.linalg.norm(tool.T_JF[:3, 3])), tool.joint
    while row >= 0 and joints[row].parent >= 0:
        length += float(np.linalg.norm(joints[row].origin[:3, 3]))
        row = joints[row].parent
    base_W = np.zeros(3) if row < 0 else np.asarray(joints[row].origin)[:3, 3]
    far = float(np.linalg.norm(T_WT[:3, 3] - base_W))
    if far <= length:
        return None
    x, y, z = T_WT[:3, 3]
    return (
        f"translation: the tool would be at ({x:.3f}, {y:.3f}, {z:.3f}) m, {far:.3f} m from the "
        f"first joint; no posture reaches beyond {length:.3f} m"
    )


def pose_errors(T_WT: Array, goal: Array) -> tuple[float, float]:
    """Distance [m] and angle [rad] from the tool to its goal."""
    chord = float(np.linalg.norm(goal[:3, :3] - T_WT[:3, :3]))
    angle = 2.0 * math.asin(min(chord / math.sqrt(8.0), 1.0))
    return float(np.linalg.norm(goal[:3, 3] - T_WT[:3, 3])), angle

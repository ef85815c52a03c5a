"""Goals of MoveRobot, whoever pursues them: what only ROS asks of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

from proxcgal.server.goals import END_EFFECTOR, GoalFeedback, GoalResult, JointGoal


class GoalServer(Protocol):
    """Whoever takes goals: every goal that it takes ends exactly once."""

    def send_goal(self, goal: JointGoal) -> int:
        """Its number. Raises: GoalRefusedError."""

    def cancel(self, number: int) -> bool:
        """False where it has ended already."""

    def feedback(self, number: int) -> GoalFeedback | None:
        """None where it is not pursued."""

    def result(self, number: int) -> GoalResult | None:
        """None while it has not ended."""


def goal_problems(goal: JointGoal, base_frames: Sequence[str]) -> list[str]:
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

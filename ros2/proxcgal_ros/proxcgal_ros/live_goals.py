"""Goals for the arm that the node controls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from proxcgal.core.modes import STOP
from proxcgal.core.transforms import pose_errors
from proxcgal.evaluation.termination import Outcome
from proxcgal.models.robots import Robot
from proxcgal.server.goal_lifecycle import GoalLedger, Pursued
from proxcgal.server.goals import (
    BASE,
    GoalFeedback,
    GoalRefusedError,
    GoalResult,
    JointGoal,
    goal_pose,
    reach_of,
    reach_problem,
)
from proxcgal.sim.tick import TickInput, TickResult
from proxcgal_ros.goals import goal_problems

Array = NDArray[np.float64]

HELD_OFF = 0.5  # activation of avoidance at which an obstacle is why a goal was not reached


@dataclass(slots=True)
class Rules:
    """When a goal ends; may change between ticks."""

    position_tolerance: float = 0.03  #: [m]
    angle_tolerance: float = 0.05  #: [rad]
    timeout: float = 60.0  #: [s]
    way_out: str = "start the node anew"  #: of a STOP, once its cause is gone
    preempt: bool = True  #: a goal replaces the one that is pursued; else it is refused


@dataclass(slots=True, kw_only=True)
class _Goal(Pursued):
    T_WT: Array


class LiveGoals:
    """Gives each tick its goal, and ends each goal exactly once.

    Without one the arm is held where the last one ended.
    """

    def __init__(self, robot: Robot, base_frame: str, rules: Rules, period: float) -> None:
        """Nothing is pursued.

        Args:
            robot: the arm.
            base_frame: that its base is called by, beside the thesis's name.
            rules: when goals end.
            period: [s] the most that commands may change within one tick counts by.
        """
        self._robot = robot
        self._reach = reach_of(robot)
        self._base_frames = (BASE, base_frame)
        self.rules = rules
        self._period = period
        self._goals: GoalLedger[_Goal] = GoalLedger()
        self._held: Array | None = None
        self._tool: Array | None = None
        self._q: Array | None = None
        self._time = 0.0
        self._ticked = -np.inf  # [s] when the last tick was
        self._last: TickResult | None = None

    def send_goal(self, goal: JointGoal) -> int:
        """Its number. Raises: GoalRefusedError with every reason."""
        problems = goal_problems(goal, self._base_frames)
        if goal.init:
            problems.append(
                f"init_config_name = {goal.init!r}: a real arm is not put anywhere; leave it empty"
            )
        if self._tool is None:
            problems.append("no joint states yet")
        if self._last is not None and self._last.mode == STOP:
            problems.append(f"the monitor has stopped the arm: {self.rules.way_out}")
        if not self.rules.preempt and self._goals.active is not None:
            problems.append(f"goal {self._goals.active.number} is being pursued")
        if not problems and self._tool is not None:
            T_WT = goal_pose(goal, self._tool)
            far = reach_problem(self._reach, T_WT)
            if far is None:
                number = self._goals.next
                if self._goals.active is not None:
                    self._end("cancelled", f"preempted by goal {number}")
                return self._goals.take(_Goal(number=number, begun=self._time, T_WT=T_WT))
            problems.append(far)
        raise GoalRefusedError("\n".join(problems))

    def cancel(self, number: int) -> bool:
        """Brakes within limits; the goal ends once the arm has braked. False: it had ended.

        Then it rests, or a task above `reach` still moves it, which the goal's reason says.
        """
        return self._goals.cancel(number, self._time, np.asarray(self._robot.qdd_max))

    def feedback(self, number: int) -> GoalFeedback | None:
        """How it is doing; None where it is not pursued."""
        active = self._goals.active
        if active is None or active.number != number or self._tool is None or self._q is None:
            return None
        qd = np.zeros_like(self._q) if self._last is None else self._last.qd
        velocity = np.asarray(self._robot.tool_jacobian(self._q)) @ qd
        return GoalFeedback(
            number, active.state, self._time - active.begun, float(np.linalg.norm(velocity[:3])),
            float(np.linalg.norm(velocity[3:])), *pose_errors(self._tool, active.T_WT),
        )  # fmt: skip

    def result(self, number: int) -> GoalResult | None:
        """How it ended; None while it has not."""
        return self._goals.result(number)

    def at(self, time: float, q: Array) -> Array:
        """(4, 4) T_WT that the tick at this time is given, the arm being at q (n_q,)."""
        self._time = time
        if np.isfinite(q).all():
            self._q, self._tool = q, np.asarray(self._robot.tool_pose(q))
        if self._tool is None:  # not a number from the first: the tick says so
            return np.eye(4)
        active = self._goals.active
        if active is not None and active.state == "executing":
            return active.T_WT
        if self._held is None or active is not None:
            self._held = self._tool  # nothing is asked of the tool: it comes to rest
        return self._held

    def after(self, inputs: TickInput, result: TickResult) -> None:
        """Whether the goal has ended with this tick."""
        passed, self._ticked = min(inputs.time - self._ticked, self._period), inputs.time
        self._last = result
        active = self._goals.active
        if active is None or self._tool is None:
            return
        errors = pose_errors(self._tool, active.T_WT)
        if result.mode == STOP:
            reasons = ", ".join(sorted({found.reason for found in result.findings}))
            self._end("aborted", f"the monitor stopped the arm: {reasons}")
        elif active.state == "cancelling":
            why = self._goals.braked(inputs.time, passed, result)
            if why is not None:
                self._end("cancelled", why)
        elif errors[0] <= self.rules.position_tolerance and errors[1] <= self.rules.angle_tolerance:
            self._end("succeeded", "the tool is at the goal")
            self._held = active.T_WT
        elif inputs.time - active.begun > self.rules.timeout:
            told = f"not reached within {self.rules.timeout:g} s"
            if result.activation() > HELD_OFF:
                told += f": held off by the obstacle, {result.seen:.3f} m away"
            self._end("aborted", told)

    def close(self) -> None:
        """The node ends."""
        if self._goals.active is not None:
            self._end("aborted", "the node was shut down")

    def _end(self, outcome: Outcome, reason: str) -> None:
        active = self._goals.active
        assert active is not None
        assert self._tool is not None
        self._held = self._tool
        self._goals.end(outcome, reason, self._time, pose_errors(self._tool, active.T_WT))

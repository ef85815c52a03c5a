"""How the 12-joint arm pursues a goal, tick by tick, and why that ends."""

import threading
from dataclasses import dataclass

from proxcgal.core.errors import ProxError
from proxcgal.core.transforms import pose_errors
from proxcgal.core.typing import Array
from proxcgal.evaluation.stall_diagnosis import concluded
from proxcgal.evaluation.termination import Ending, GoalWatch, Outcome
from proxcgal.server.goal_lifecycle import GoalLedger, Pursued
from proxcgal.server.goals import JointGoal, goal_pose
from proxcgal.server.joint_arm import JointArm


@dataclass(slots=True, kw_only=True)
class PursuedGoal(Pursued):
    """A goal that has not ended."""

    goal: JointGoal
    T_WT: Array | None = None  # (4, 4) once the arm stands where it begins
    watch: GoalWatch | None = None
    over: bool = False  # it is followed no more: what held the arm is being found out
    ending: Ending | None = None  # what came of that
    remain: tuple[float, float] | None = None  # [m] and [rad] to the goal as it was given up


class JointPursuit:
    """Moves the arm for the goal that the ledger pursues; not for several threads."""

    def __init__(self, arm: JointArm, goals: GoalLedger[PursuedGoal]) -> None:
        """Args: who moves, and for what."""
        self._arm, self._goals = arm, goals

    def begin(self, active: PursuedGoal) -> None:
        """The arm stands where the goal begins: from here on it is followed."""
        T_WT = goal_pose(active.goal, self._arm.tool)
        self._arm.follow(T_WT)
        active.T_WT = T_WT
        active.watch = GoalWatch(self._arm.scenario.finish, T_WT)
        active.state = "executing"

    def step(self, *, wait: bool) -> None:
        """One tick of the arm.

        Args:
            wait: find out within it what holds an arm that is given up.
        """
        arm = self._arm
        arm.move()
        T_WT = arm.tool
        if self._goals.active is not None:
            self._advance(self._goals.active, T_WT, wait=wait)
        active = self._goals.active
        following = active is not None and active.state == "executing" and not active.over
        if active is not None and not active.over and not following:
            arm.held = T_WT  # nothing is asked of the tool: it comes to rest
        arm.tick(following=following)

    def _advance(self, active: PursuedGoal, T_WT: Array, *, wait: bool) -> None:
        """Whether the goal ends before this tick, or can begin."""
        arm = self._arm
        if active.state == "cancelling":
            reason = self._goals.braked(arm.time, arm.period, arm.last)
            if reason is not None:
                self.end("cancelled", reason)
        elif active.over:
            if active.ending is not None:
                self.end(active.ending.outcome, active.ending.reason, active.remain)
        elif arm.stopped:
            self.end("aborted", f"the monitor stopped the arm: {arm.findings}")
        elif active.state == "starting":
            if arm.resting:
                arm.place(active.goal.init)
                self.begin(active)
        elif active.watch is not None:
            ending = active.watch(arm.time - active.begun, T_WT)
            if ending is not None:
                self._conclude(ending, active, wait=wait)

    def _conclude(self, ending: Ending, active: PursuedGoal, *, wait: bool) -> None:
        arm = self._arm
        setup, last, q, time, points_W = arm.setup, arm.last, arm.q, arm.time, arm.points_W
        if ending.outcome == "succeeded" or last is None:
            self.end(ending.outcome, ending.reason)
            if ending.outcome == "succeeded" and active.T_WT is not None:
                arm.held = active.T_WT
            return
        if active.T_WT is not None:  # of the tick that the reason is about
            active.remain = pose_errors(arm.tool, active.T_WT)

        def judge() -> None:
            try:
                active.ending = concluded(setup, ending, last, q, points_W, time)
            except ProxError:  # then without what held it
                active.ending = ending

        if wait:
            judge()
            found = active.ending or ending
            self.end(found.outcome, found.reason, active.remain)
            return
        arm.held = arm.tool  # it stays where it was given up
        active.over = True
        threading.Thread(target=judge, daemon=True).start()

    def end(self, outcome: Outcome, reason: str, remain: tuple[float, float] | None = None) -> None:
        """Ends the goal here and now; the tool is held where it is.

        Args:
            outcome: of the goal.
            reason: as text.
            remain: [m] and [rad] to the goal; left out: from where the arm is now.
        """
        active = self._goals.active
        assert active is not None
        self._arm.held = self._arm.tool
        self._goals.end(outcome, reason, self._arm.time, remain or self.errors(active))

    def errors(self, active: PursuedGoal) -> tuple[float, float]:
        """What remains to the goal [m] and [rad]; before it begins, from where the tool is."""
        T_WT = self._arm.tool
        goal = goal_pose(active.goal, T_WT) if active.T_WT is None else active.T_WT
        return pose_errors(T_WT, goal)

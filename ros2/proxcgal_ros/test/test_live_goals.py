"""Goals of a live arm, over ticks of the real controller at times as they come."""

from __future__ import annotations

import numpy as np
import pytest
from proxcgal_ros.live_goals import LiveGoals, Rules

from proxcgal.scenario.loading import load_scenario
from proxcgal.scenario.setup import Setup
from proxcgal.server.goals import GoalRefusedError, GoalResult, JointGoal
from proxcgal.sim.tick import TickInput, TickResult

PERIOD = 0.01


class Arm:
    """An arm that follows its commands, ticks coming early and late."""

    def __init__(self, *changes: str) -> None:
        self.setup = Setup.of(load_scenario("front_plane", changes))
        self.ctrl = self.setup.make_controller("wb_known", 0)
        self.goals = LiveGoals(self.setup.robot, "base_link", Rules(timeout=8.0), PERIOD)
        self.q, self.qd, self.time = self.setup.q0.copy(), np.zeros(6), 5.0
        self.random = np.random.default_rng(0)
        self.tick()

    def tick(self) -> None:
        step = PERIOD * self.random.choice([0.3, 0.7, 1.0, 1.0, 1.4])
        self.time += step
        self.q = self.q + step * self.qd
        T_WT = self.goals.at(self.time, self.q)
        out = self.ctrl.tick_known(self.time, self.q, np.zeros((0, 3)), T_WT)
        self.qd = np.array(out.qd)
        self.goals.after(TickInput(self.time, self.q, T_WT), TickResult.of(out, 0, 0.0))

    def until_the_end(self, number: int) -> GoalResult:
        for _ in range(2000):
            if (ended := self.goals.result(number)) is not None:
                return ended
            self.tick()
        raise AssertionError("it has not ended")


def far() -> JointGoal:
    return JointGoal(translation=(0.0, 0.0, -0.5), frame="end_effector")


def test_a_cancelled_goal_ends_once_the_arm_rests() -> None:
    arm = Arm()
    number = arm.goals.send_goal(far())
    for _ in range(100):
        arm.tick()
    assert np.abs(arm.qd).max() > 0.1
    assert arm.goals.cancel(number)
    assert not arm.goals.cancel(number)
    ended = arm.until_the_end(number)
    assert (ended.outcome, ended.reason) == ("cancelled", "cancelled by the client")
    assert np.abs(arm.qd).max() <= 1e-3
    assert not arm.goals.cancel(number)


def test_a_cancelled_goal_says_what_still_moves_the_arm() -> None:
    arm = Arm("controller.tasks=['minimum_altitude', 'reach']", "goal.offset=[0.0, 0.0, 0.0]")
    number = arm.goals.send_goal(JointGoal(translation=(0.3, 0.1, 0.0), frame="end_effector"))
    for _ in range(40):
        arm.tick()
    assert arm.goals.cancel(number)
    ended = arm.until_the_end(number)
    assert ended.reason == "cancelled by the client; minimum_altitude still moves the arm"
    assert ended.time_s < 2.0


def test_a_goal_that_is_not_reached_in_time_is_aborted_and_the_tool_held() -> None:
    arm = Arm()
    number = arm.goals.send_goal(JointGoal(translation=(0.0, 0.0, 1.85)))
    ended = arm.until_the_end(number)
    assert (ended.outcome, ended.reason) == ("aborted", "not reached within 8 s")
    held = arm.goals.at(arm.time, arm.q)
    for _ in range(50):
        arm.tick()
    assert arm.goals.at(arm.time, arm.q) is held


def test_a_second_goal_preempts_or_is_refused() -> None:
    arm = Arm()
    first = arm.goals.send_goal(far())
    second = arm.goals.send_goal(far())
    ended = arm.goals.result(first)
    assert ended is not None
    assert (ended.outcome, ended.reason) == ("cancelled", f"preempted by goal {second}")
    arm.goals.rules.preempt = False
    with pytest.raises(GoalRefusedError, match=f"goal {second} is being pursued"):
        arm.goals.send_goal(far())
    assert arm.goals.result(second) is None

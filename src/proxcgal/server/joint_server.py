"""Goals for the 12-joint robot: sent, followed, cancelled, preempted; one end to each.

The arm is simulated: it follows its velocity commands exactly, under the scenario's controller on
points of the scene itself. Source: [JR] 3.2.1 (action server) and 4.1 (goals).
"""

import math
import threading
import time as clock
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from proxcgal.core.closing import Closing
from proxcgal.core.errors import ConfigError
from proxcgal.core.typing import Array
from proxcgal.models.robots import Robot
from proxcgal.scenario.joint_scenario import JointScenario
from proxcgal.scenario.loading import load_scenario
from proxcgal.server.goal_lifecycle import GoalLedger
from proxcgal.server.goals import (
    GoalFeedback,
    GoalRefusedError,
    GoalResult,
    JointGoal,
    goal_pose,
    problems_of,
    reach_of,
    reach_problem,
)
from proxcgal.server.joint_arm import JointArm
from proxcgal.server.pursuit import JointPursuit, PursuedGoal


class JointRobotServer(Closing):
    """Takes goals one after another; every goal that it takes ends exactly once.

    Without `start` nothing moves by itself: each `step` is one tick. With it a thread makes them in
    real time; every method may be called from any thread.
    """

    def __init__(
        self,
        scenario: str | Path | JointScenario = "joint_free",
        overrides: Sequence[str] = (),
        *,
        second: Literal["preempt", "refuse"] = "preempt",
        robot: Robot | None = None,
    ) -> None:
        """Sets the robot up in the first initial configuration of the scenario.

        Args:
            scenario: of kind `joint`: robot, obstacles, tasks, configurations, tolerances.
            overrides: `key.sub=value`, applied after the file.
            second: what a goal does while another is executed.
            robot: the scenario's, where it is loaded already.

        Raises:
            ConfigError: another kind of scenario, or what does not fit.
        """
        if not isinstance(scenario, JointScenario):
            loaded = load_scenario(scenario, overrides)
            if not isinstance(loaded, JointScenario):
                raise ConfigError(f"scenario {loaded.name}: kind = {loaded.kind!r}; needs 'joint'")
            scenario = loaded
        if second not in ("preempt", "refuse"):
            raise ConfigError(f"second = {second!r}: must be 'preempt' or 'refuse'")
        self._second = second
        self._lock = threading.RLock()
        self._arm = JointArm(scenario, robot)
        self._goals: GoalLedger[PursuedGoal] = GoalLedger()
        self._pursuit = JointPursuit(self._arm, self._goals)
        self._reach = reach_of(self._arm.robot)
        self._thread: threading.Thread | None = None
        self._failure = ""  # of the thread, after which nothing moves any more
        self._ending = threading.Event()
        self._closed = False

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self._arm.robot

    @property
    def q(self) -> Array:
        """(n_q,) where the arm stands."""
        with self._lock:
            return self._arm.q.copy()

    @property
    def qd(self) -> Array:
        """(n_q,) how fast it moves, as it was commanded."""
        with self._lock:
            return self._arm.qd.copy()

    @property
    def period(self) -> float:
        """[s] from tick to tick."""
        return self._arm.period

    @property
    def tasks(self) -> tuple[str, ...]:
        """The tasks that run, the most important first."""
        return self._arm.scenario.controller.levels

    def set_tasks(self, tasks: Sequence[str], off: Sequence[str] = ()) -> None:
        """Another stack, order or choice of tasks, by name, from the next goal on.

        Args:
            tasks: names of tasks or stacks, in order of priority.
            off: of these, what is left out.

        Raises:
            ConfigError: an unknown name, a goal is being executed, or the monitor has stopped
                the arm.
        """
        with self._lock:
            if self._goals.active is not None:
                raise ConfigError(f"tasks: goal {self._goals.active.number} is being executed")
            if self._arm.stopped:  # a new controller would forget it
                raise ConfigError("tasks: the monitor has stopped the arm; a reset comes first")
            self._arm.set_tasks(tasks, off)

    def send_goal(self, goal: JointGoal) -> int:
        """Takes a goal on, or says why not; nothing has moved when this returns.

        Returns:
            The goal's number.

        Raises:
            GoalRefusedError: not finite, an unknown frame or configuration, one that violates a
                joint limit, out of reach, another goal executed (where that refuses), no goal at
                all, a server that was closed.
        """
        if not isinstance(goal, JointGoal):
            raise GoalRefusedError(f"goal = {str(goal)[:80]}: must be a JointGoal")
        with self._lock:
            problems = self._problems(goal)
            if problems:
                raise GoalRefusedError("\n".join(problems))
            number = self._goals.next
            if self._goals.active is not None:
                self._pursuit.end("cancelled", f"preempted by goal {number}")
            taken = PursuedGoal(number=number, begun=self._arm.time, state="starting", goal=goal)
            self._goals.take(taken)
            if not goal.init:
                self._pursuit.begin(taken)
            return number

    def cancel(self, number: int) -> bool:
        """Brakes within limits; the goal ends once the arm has braked. False: it had ended.

        Then it rests, or a task above `reach` still moves it, which the goal's reason says.
        """
        with self._lock:
            return self._goals.cancel(number, self._arm.time, np.asarray(self.robot.qdd_max))

    def step(self, *, wait: bool = True) -> None:
        """One tick: the arm moves by its last command, and is given the next.

        Args:
            wait: find out within the tick what holds an arm that is given up, which takes many
                ticks' time; otherwise that is done beside them, and the goal ends when it is known.
        """
        with self._lock:
            self._pursuit.step(wait=wait)

    def feedback(self) -> GoalFeedback | None:
        """How the goal that is executed is doing; None where there is none."""
        with self._lock:
            active = self._goals.active
            if active is None:
                return None
            velocity = self._arm.tool_velocity
            return GoalFeedback(
                active.number, active.state, self._arm.time - active.begun,
                float(np.linalg.norm(velocity[:3])), float(np.linalg.norm(velocity[3:])),
                *self._pursuit.errors(active),
            )  # fmt: skip

    def result(self, number: int) -> GoalResult | None:
        """How a goal ended; None while it has not, and for one that never was or is forgotten."""
        with self._lock:
            return self._goals.result(number)

    def wait(self, number: int, timeout: float = math.inf) -> GoalResult | None:
        """The goal's end; steps until then where no thread does.

        Args:
            number: of the goal.
            timeout: [s] of the arm's own time; past it None is returned.
        """
        begin = self._arm.time
        while (found := self.result(number)) is None and self._arm.time - begin < timeout:
            active = self._goals.active
            if active is None or active.number != number:  # it has ended, or never was
                return self.result(number)
            if self._thread is None:
                self.step()
            else:
                clock.sleep(self.period)
        return found

    def reset(self) -> bool:
        """Leaves a STOP of the monitor, once its cause is gone; no message of a client does."""
        with self._lock:
            return self._arm.reset()

    def start(self) -> None:
        """Makes the ticks in real time, in a thread, until `close`.

        Raises:
            ConfigError: it was closed.
        """
        if self._closed:
            raise ConfigError("the server was closed: make another one")
        if self._thread is None:
            self._ending.clear()
            self._thread = threading.Thread(target=self._spin, daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Ends the thread; a goal that is still executed is aborted at once."""
        self._closed = True
        self._ending.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        with self._lock:
            if self._goals.active is not None:
                self._pursuit.end("aborted", "the server was closed")

    def _spin(self) -> None:
        due = clock.monotonic()
        try:
            while not self._ending.is_set():
                self.step(wait=False)
                due = max(due + self.period, clock.monotonic() - 0.1)  # what is lost stays lost
                self._ending.wait(max(due - clock.monotonic(), 0.0))
        except Exception as error:  # else a goal would wait for its end for ever
            with self._lock:
                self._failure = f"the server has failed: {error}"
                if self._goals.active is not None:
                    self._pursuit.end("aborted", self._failure)
            raise

    def _problems(self, goal: JointGoal) -> list[str]:
        """Why a goal is not taken on, a line each."""
        arm, configurations = self._arm, self._arm.scenario.configurations
        problems = problems_of(goal, self.robot, configurations)
        if self._second == "refuse" and self._goals.active is not None:
            problems.append(f"goal {self._goals.active.number} is being executed")
        if self._closed:
            problems.append("the server was closed: make another one")
        if self._failure:
            problems.append(self._failure)
        if arm.stopped:
            problems.append("the monitor has stopped the arm; only a reset where it runs helps")
        if problems:
            return problems
        start = np.array(configurations[goal.init]) if goal.init else arm.q
        with np.errstate(over="ignore"):  # what overflows is out of reach
            T_WT = goal_pose(goal, np.asarray(self.robot.tool_pose(start)))
        far = reach_problem(self._reach, T_WT)
        return [far] if far else []

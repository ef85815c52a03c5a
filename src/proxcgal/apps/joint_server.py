"""Goals for the 12-joint robot: sent, followed, cancelled, preempted; one end to each.

The arm is simulated: it follows its velocity commands exactly, under the scenario's controller on
points of the scene itself. Source: [JR] 3.2.1 (action server) and 4.1 (goals).
"""

from __future__ import annotations

import math
import threading
import time as clock
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from proxcgal import _core
from proxcgal.apps.joint_goals import (
    AT_REST,
    KEPT_RESULTS,
    STOPPED_AFTER,
    GoalFeedback,
    GoalRefusedError,
    GoalResult,
    JointGoal,
    State,
    goal_pose,
    problems_of,
    reach_of,
    reach_problem,
)
from proxcgal.closing import Closing
from proxcgal.errors import ConfigError, ProxError
from proxcgal.models import Robot
from proxcgal.sim.arms import tool_jacobian
from proxcgal.sim.finish import Ending, GoalWatch, Outcome, pose_errors
from proxcgal.sim.holding import concluded
from proxcgal.sim.scenario import load_scenario
from proxcgal.sim.scenario_joint import JointScenario
from proxcgal.sim.setup import Setup
from proxcgal.sim.ticks import Tick, TickInput, TickResult, TickTruth

Array = NDArray[np.float64]

_STOP = 3  # mode


@dataclass(slots=True)
class _Active:
    number: int
    goal: JointGoal
    begun: float
    T_WT: Array | None = None  # of the goal, once the arm stands where it begins
    watch: GoalWatch | None = None
    state: State = "starting"
    cancelled: float = math.inf  # [s] when
    over: bool = False  # it is followed no more: what held the arm is being found out
    ending: Ending | None = None  # what came of that


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
        self._setup = Setup.of(scenario, robot)
        self._cloud = self._setup.known_cloud()
        self._q = self._setup.q0.copy()
        self._qd = np.zeros_like(self._q)
        self._time = 0.0
        self._ticks = 0
        self._count = 0
        self._active: _Active | None = None
        self._results: OrderedDict[int, GoalResult] = OrderedDict()
        self._last: TickResult | None = None
        self._reach = reach_of(self._setup.robot)
        self._law = self._made()
        self._held = np.asarray(self._setup.robot.tool_pose(self._q))
        self._thread: threading.Thread | None = None
        self._failure = ""  # of the thread, after which nothing moves any more
        self._ending = threading.Event()

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self._setup.robot

    @property
    def q(self) -> Array:
        """(n_q,) where the arm stands."""
        with self._lock:
            return self._q.copy()

    @property
    def period(self) -> float:
        """[s] from tick to tick."""
        return float(self._law.config.period)

    @property
    def tasks(self) -> tuple[str, ...]:
        """The tasks that run, the most important first."""
        return self._setup.scenario.controller.levels

    def set_tasks(self, tasks: Sequence[str], off: Sequence[str] = ()) -> None:
        """Another stack, order or choice of tasks, by name, from the next goal on.

        Args:
            tasks: names of tasks or stacks, in order of priority.
            off: of these, what is left out.

        Raises:
            ConfigError: an unknown name, a goal is being executed, or the monitor has stopped
                the arm.
        """
        from proxcgal.sim.scenario import change_scenario

        with self._lock:
            if self._active is not None:
                raise ConfigError(f"tasks: goal {self._active.number} is being executed")
            if self._stopped:  # a new controller would forget it
                raise ConfigError("tasks: the monitor has stopped the arm; a reset comes first")
            changes = [f"controller.{k}={list(v)!r}" for k, v in (("tasks", tasks), ("off", off))]
            changed = change_scenario(self._setup.scenario, "tasks", changes)
            self._setup = replace(self._setup, scenario=changed)
            self._law = self._made()

    def send_goal(self, goal: JointGoal) -> int:
        """Takes a goal on, or says why not; nothing has moved when this returns.

        Returns:
            The goal's number.

        Raises:
            GoalRefusedError: not finite, an unknown frame or configuration, one that violates a
                joint limit, out of reach, another goal executed (where that refuses).
        """
        with self._lock:
            problems = self._problems(goal)
            if problems:
                raise GoalRefusedError("\n".join(problems))
            self._count += 1
            if self._active is not None:
                self._end("cancelled", f"preempted by goal {self._count}")
            self._active = _Active(self._count, goal, self._time)
            if not goal.init:
                self._begin(self._active)
            return self._count

    def cancel(self, number: int) -> bool:
        """Brakes within limits; the goal has ended once the arm rests. False: it had ended."""
        with self._lock:
            active = self._active
            if active is None or active.number != number or active.state == "cancelling":
                return False
            active.state, active.cancelled = "cancelling", self._time
            return True

    def step(self, *, wait: bool = True) -> None:
        """One tick: the arm moves by its last command, and is given the next.

        Args:
            wait: find out within the tick what holds an arm that is given up, which takes many
                ticks' time; otherwise that is done beside them, and the goal ends when it is known.
        """
        with self._lock:
            self._step(wait=wait)

    def feedback(self) -> GoalFeedback | None:
        """How the goal that is executed is doing; None where there is none."""
        with self._lock:
            if self._active is None:
                return None
            velocity = tool_jacobian(self.robot, self._q) @ self._qd
            return GoalFeedback(
                self._active.number, self._active.state, self._time - self._active.begun,
                float(np.linalg.norm(velocity[:3])), float(np.linalg.norm(velocity[3:])),
                *self._errors(self._active),
            )  # fmt: skip

    def result(self, number: int) -> GoalResult | None:
        """How a goal ended; None while it has not, and for one that never was or is forgotten."""
        with self._lock:
            return self._results.get(number)

    def wait(self, number: int, timeout: float = math.inf) -> GoalResult | None:
        """The goal's end; steps until then where no thread does.

        Args:
            number: of the goal.
            timeout: [s] of the arm's own time; past it None is returned.
        """
        begin = self._time
        while (found := self.result(number)) is None and self._time - begin < timeout:
            active = self._active
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
            left = bool(self._law.reset())
            if left:
                self._last = None  # it still says STOP
            return left

    def start(self) -> None:
        """Makes the ticks in real time, in a thread, until `close`."""
        if self._thread is None:
            self._ending.clear()
            self._thread = threading.Thread(target=self._spin, daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Ends the thread; a goal that is still executed is aborted at once."""
        self._ending.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        with self._lock:
            if self._active is not None:
                self._end("aborted", "the server was closed")

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
                if self._active is not None:
                    self._end("aborted", self._failure)
            raise

    def _made(self) -> _core.Controller:
        self._ticks, self._last = 0, None
        return self._setup.make_controller("wb_known", len(self._cloud))

    def _problems(self, goal: JointGoal) -> list[str]:
        """Why a goal is not taken on, a line each."""
        configurations = self._scenario.configurations
        problems = problems_of(goal, self.robot, configurations)
        if self._second == "refuse" and self._active is not None:
            problems.append(f"goal {self._active.number} is being executed")
        if self._failure:
            problems.append(self._failure)
        if self._stopped:
            problems.append("the monitor has stopped the arm; only a reset where it runs helps")
        if problems:
            return problems
        start = np.array(configurations[goal.init]) if goal.init else self._q
        with np.errstate(over="ignore"):  # what overflows is out of reach
            T_WT = goal_pose(goal, np.asarray(self.robot.tool_pose(start)))
        far = reach_problem(self._reach, T_WT)
        return [far] if far else []

    @property
    def _stopped(self) -> bool:
        return self._last is not None and self._last.mode == _STOP

    @property
    def _scenario(self) -> JointScenario:
        scenario = self._setup.scenario
        assert isinstance(scenario, JointScenario)
        return scenario

    def _begin(self, active: _Active) -> None:
        """The arm stands where the goal begins: from here on it is followed."""
        T_WT = goal_pose(active.goal, np.asarray(self.robot.tool_pose(self._q)))
        self._setup = replace(self._setup, goals=(T_WT,))
        active.T_WT = T_WT
        active.watch = GoalWatch(self._scenario.finish, T_WT)
        active.state = "executing"

    def _place(self, active: _Active) -> None:
        """Puts the resting arm into the goal's configuration, as [JR] does with its simulation."""
        self._q = np.array(self._scenario.configurations[active.goal.init])
        self._qd = np.zeros_like(self._q)
        self._law = self._made()
        self._begin(active)

    def _step(self, *, wait: bool) -> None:
        period = self.period
        self._q = self._q + self._qd * period
        active = self._active
        T_WT = np.asarray(self.robot.tool_pose(self._q))
        if active is not None:
            self._advance(active, T_WT, wait=wait)
            active = self._active
        moving = active is not None and active.state == "executing" and active.T_WT is not None
        if active is not None and active.over:
            moving = False  # it stays where it was given up
        elif active is not None and not moving:
            self._held = T_WT  # nothing is asked of the tool: it comes to rest
        goal = active.T_WT if moving and active is not None else self._held
        cloud = self._cloud
        points_W, now = cloud(self._time), self._ticks * period
        velocity_W = None if cloud.still else cloud.velocities(self._time)
        out = self._law.tick_known(now, self._q, points_W, goal, velocity_W)
        self._ticks += 1
        self._time += period
        self._last = TickResult.of(out, 0, 0.0)
        self._qd = self._last.qd

    def _advance(self, active: _Active, T_WT: Array, *, wait: bool) -> None:
        """Whether the goal ends before this tick, or can begin."""
        resting = bool(np.abs(self._qd).max() <= AT_REST)
        if active.state == "cancelling":
            if resting or self._time - active.cancelled > STOPPED_AFTER:
                self._end("cancelled", "cancelled by the client")
        elif active.over:
            if active.ending is not None:
                self._end(active.ending.outcome, active.ending.reason)
        elif self._stopped and self._last is not None:
            found = ", ".join(sorted({f.reason for f in self._last.findings}))
            self._end("aborted", f"the monitor stopped the arm: {found}")
        elif active.state == "starting":
            if resting:
                self._place(active)
        elif active.watch is not None:
            ending = active.watch(self._time - active.begun, T_WT)
            if ending is not None:
                self._conclude(ending, active, wait=wait)

    def _conclude(self, ending: Ending, active: _Active, *, wait: bool) -> None:
        if ending.outcome == "succeeded" or self._last is None:
            self._end(ending.outcome, ending.reason)
            if ending.outcome == "succeeded" and active.T_WT is not None:
                self._held = active.T_WT
            return
        given = TickInput(time=self._time, q=self._q, goal=self._setup.goal, known=True)
        last, setup = Tick(given, self._last, TickTruth()), self._setup
        points_W = np.array(self._cloud(self._time))

        def judge() -> None:
            try:
                active.ending = concluded(setup, ending, last, points_W)
            except ProxError:  # then without what held it
                active.ending = ending

        if wait:
            judge()
            found = active.ending or ending
            self._end(found.outcome, found.reason)
            return
        self._held = np.asarray(self.robot.tool_pose(self._q))
        active.over = True
        threading.Thread(target=judge, daemon=True).start()

    def _end(self, outcome: Outcome, reason: str) -> None:
        """The one place where a goal ends."""
        active = self._active
        assert active is not None
        assert active.number not in self._results
        self._held = np.asarray(self.robot.tool_pose(self._q))
        self._results[active.number] = GoalResult(
            active.number, outcome, reason, self._time - active.begun, *self._errors(active)
        )
        while len(self._results) > KEPT_RESULTS:
            self._results.popitem(last=False)
        self._active = None

    def _errors(self, active: _Active) -> tuple[float, float]:
        T_WT = np.asarray(self.robot.tool_pose(self._q))
        goal = goal_pose(active.goal, T_WT) if active.T_WT is None else active.T_WT
        return pose_errors(T_WT, goal)

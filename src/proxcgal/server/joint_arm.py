"""The 12-joint arm, simulated: a source of the common loop that follows one goal after another."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from proxcgal.core.modes import STOP
from proxcgal.core.typing import Array
from proxcgal.models.robots import Robot
from proxcgal.scenario.joint_scenario import JointScenario
from proxcgal.scenario.loading import change_scenario
from proxcgal.scenario.setup import Setup
from proxcgal.server.goals import AT_REST
from proxcgal.sim.actuation import Actuation
from proxcgal.sim.loop import run_ticks
from proxcgal.sim.tick import TickInput, TickResult


class JointArm:
    """Under the scenario's controller, on points of the scene itself; not for several threads."""

    def __init__(self, scenario: JointScenario, robot: Robot | None) -> None:
        """At rest in the first initial configuration. Raises: ProxError, what does not fit."""
        self.setup = Setup.of(scenario, robot)  #: with the goal that is followed
        self.robot = self.setup.robot
        self.time = 0.0  #: [s]
        self.last: TickResult | None = None  #: of the controller's last tick
        self._cloud = self.setup.known_cloud()
        self._start(self.setup.q0)
        #: (4, 4) where the tool is to stay in the ticks that follow no goal.
        self.held = self.tool
        self._goal = self.held

    @property
    def scenario(self) -> JointScenario:
        """The scenario, with the tasks that run."""
        scenario = self.setup.scenario
        assert isinstance(scenario, JointScenario)
        return scenario

    @property
    def period(self) -> float:
        """[s] from tick to tick."""
        return float(self.ctrl.config.period)

    @property
    def q(self) -> Array:
        """(n_q,)."""
        return self._actuation.q

    @property
    def qd(self) -> Array:
        """(n_q,) of the last command."""
        return self._actuation.qd

    @property
    def tool(self) -> Array:
        """(4, 4) T_WT."""
        return np.asarray(self.robot.tool_pose(self.q))

    @property
    def tool_velocity(self) -> Array:
        """(6,) [m/s] and [rad/s] in world, as commanded."""
        return np.asarray(self.robot.tool_jacobian(self.q) @ self.qd)

    @property
    def resting(self) -> bool:
        """Does no joint move?"""
        return bool(np.abs(self.qd).max() <= AT_REST)

    @property
    def stopped(self) -> bool:
        """Has the monitor stopped it, until a reset?"""
        return self.last is not None and self.last.mode == STOP

    @property
    def findings(self) -> str:
        """What the monitor found in the last tick."""
        return ", ".join(sorted({f.reason for f in self.last.findings} if self.last else ()))

    def set_tasks(self, tasks: Sequence[str], off: Sequence[str]) -> None:
        """Another stack; the commands go on. Raises: ConfigError, an unknown name."""
        changes = [f"controller.{k}={list(v)!r}" for k, v in (("tasks", tasks), ("off", off))]
        self.setup = replace(
            self.setup, scenario=change_scenario(self.setup.scenario, "tasks", changes)
        )
        qd = self.qd
        self._start(self.q)
        self._actuation.qd = qd
        self.ctrl.go_on_from(qd)  # the arm may still come to rest after its last goal

    def reset(self) -> bool:
        """Leaves a STOP of the monitor; False while its cause lasts, and where there is none."""
        left = bool(self.ctrl.reset())
        if left:
            self.last = None  # it still says STOP
        return left

    def place(self, configuration: str) -> None:
        """Puts it into a configuration, at rest, as [JR] does with its simulation."""
        self._start(np.array(self.scenario.configurations[configuration]))

    def follow(self, T_WT: Array) -> None:
        """A goal (4, 4) for the ticks that follow one."""
        self.setup = replace(self.setup, goals=(T_WT,))

    def move(self) -> None:
        """By the last command, for one period."""
        self._actuation.step()

    def tick(self, *, following: bool) -> None:
        """The next command: towards the goal, or to hold the tool."""
        self._goal = self.setup.goal if following else self.held
        _, self.last = next(self._loop)
        self._ticks += 1
        self.time += self.period

    def read(self) -> TickInput:
        """The next tick's inputs: the arm's state and the goal, on points of the scene itself."""
        return TickInput(self._ticks * self.period, self.q, self._goal, known=True)

    def command(self, qd: Array) -> None:
        """Velocity until the next tick (n_q,)."""
        self._actuation.qd = qd

    @property
    def points_W(self) -> Array:  # noqa: N802  a frame's suffix
        """(n, 3) points of the scene now [m]."""
        return self._cloud(self.time)

    def _start(self, q: Array) -> None:
        """A new controller for the arm at rest at a posture; its clock begins at 0."""
        self.ctrl = self.setup.make_controller("wb_known", len(self._cloud))
        self._actuation = Actuation(q, self.period)
        self._ticks = 0
        self.last = None
        self._loop = run_ticks(self, self.ctrl, known=self._cloud, begin=self.time)

"""The 12-joint arm, simulated: it follows its velocity commands exactly, one tick after another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from proxcgal import _core
from proxcgal.core.modes import STOP
from proxcgal.core.typing import Array
from proxcgal.models import Robot
from proxcgal.models.macro_micro import tool_jacobian
from proxcgal.scenario.joint_scenario import JointScenario
from proxcgal.scenario.setup import Setup
from proxcgal.server.goals import AT_REST
from proxcgal.sim.tick import Tick, TickInput, TickResult, TickTruth


class JointArm:
    """Under the scenario's controller, on points of the scene itself; not for several threads."""

    def __init__(self, scenario: JointScenario, robot: Robot | None) -> None:
        """At rest in the first initial configuration. Raises: ProxError, what does not fit."""
        self.setup = Setup.of(scenario, robot)  #: with the goal that is followed
        self.q: Array = self.setup.q0.copy()  #: (n_q,)
        self.qd: Array = np.zeros_like(self.q)  #: (n_q,) of the last command
        self.time = 0.0  #: [s]
        self.last: TickResult | None = None  #: of the controller's last tick
        self._cloud = self.setup.known_cloud()
        self._ticks = 0
        self.ctrl = self._made()
        self._held = self.tool

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.setup.robot

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
    def tool(self) -> Array:
        """(4, 4) T_WT."""
        return np.asarray(self.robot.tool_pose(self.q))

    @property
    def tool_velocity(self) -> Array:
        """(6,) [m/s] and [rad/s] in world, as commanded."""
        return tool_jacobian(self.robot, self.q) @ self.qd

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
        from proxcgal.scenario.loading import change_scenario

        changes = [f"controller.{k}={list(v)!r}" for k, v in (("tasks", tasks), ("off", off))]
        changed = change_scenario(self.setup.scenario, "tasks", changes)
        self.setup = replace(self.setup, scenario=changed)
        self.ctrl = self._made()
        self.ctrl.go_on_from(self.qd)  # the arm may still come to rest after its last goal

    def reset(self) -> bool:
        """Leaves a STOP of the monitor; False while its cause lasts, and where there is none."""
        left = bool(self.ctrl.reset())
        if left:
            self.last = None  # it still says STOP
        return left

    def place(self, configuration: str) -> None:
        """Puts it into a configuration, at rest, as [JR] does with its simulation."""
        self.q = np.array(self.scenario.configurations[configuration])
        self.qd = np.zeros_like(self.q)
        self.ctrl = self._made()

    def follow(self, T_WT: Array) -> None:
        """A goal (4, 4) for the ticks that follow one."""
        self.setup = replace(self.setup, goals=(T_WT,))

    def hold(self, T_WT: Array) -> None:
        """Where the tool is to stay (4, 4) in the ticks that follow no goal."""
        self._held = T_WT

    def move(self) -> None:
        """By the last command, for one period."""
        self.q = self.q + self.qd * self.period

    def tick(self, *, following: bool) -> None:
        """The next command: towards the goal, or to hold the tool."""
        cloud, now = self._cloud, self._ticks * self.period
        velocity_W = None if cloud.still else cloud.velocities(self.time)
        goal = self.setup.goal if following else self._held
        out = self.ctrl.tick_known(now, self.q, cloud(self.time), goal, velocity_W)
        self._ticks += 1
        self.time += self.period
        self.last = TickResult.of(out, 0, 0.0)
        self.qd = self.last.qd

    def asked(self) -> tuple[Tick, Array]:
        """The last tick, and the points (n, 3) that it would be given now [m]."""
        assert self.last is not None
        inputs = TickInput(time=self.time, q=self.q, goal=self.setup.goal, known=True)
        return Tick(inputs, self.last, TickTruth()), np.array(self._cloud(self.time))

    def _made(self) -> _core.Controller:
        self._ticks, self.last = 0, None
        return self.setup.make_controller("wb_known", len(self._cloud))

"""The arm of a walk-through, cycle by cycle: guard, hand guiding, weight, drives and brakes."""

import numpy as np

from proxcgal import _core
from proxcgal.core.typing import Array
from proxcgal.trial.walkthrough.setup import WalkSetup


class GuardedArm:
    """One arm under its guard. A cycle is `watch`, then `move` or `drive`."""

    def __init__(self, setup: WalkSetup, q: Array | None = None) -> None:
        """At rest, without torque, at `q` (n_q,) or at the start."""
        self.guard, self.guide = setup.make_guard(), setup.make_guide()
        self.physics = setup.make_physics(q)
        self._subtract_human = setup.scenario.guard.subtract_human
        self._still = np.zeros(setup.robot.n_q)
        self._torque = False

    @property
    def bounds(self) -> tuple[Array, Array]:
        """(n_q,) qd_UB [rad/s] and qdd_UB [rad/s^2]."""
        return np.array(self.guard.qd_bounds), np.array(self.guard.qdd_bounds)

    def watch(self, time: float, reset: bool) -> _core.GuardOutput:
        """What the guard finds; `reset` is its button."""
        physics = self.physics
        human = physics.human_velocity() if self._subtract_human else None
        out = self.guard.cycle(time, physics.q, physics.qd, reset, human)
        self._torque = out.torque
        return out

    def move(self, force: Array, engaged: bool) -> None:
        """The arm follows the hand, where it has torque, and has weight.

        Args:
            force: (6,) of the hand at the tool, in world [N], [N m].
            engaged: the hand's switch.

        Raises:
            SimulationError: MuJoCo warned.
        """
        command = self._still
        if self._torque:
            command = self.guide.step(self.physics.q, force, engaged).qd
        else:
            self.guide.halt()
        self.physics.step(command, self._torque, force)

    def drive(self, command: Array) -> None:
        """The arm follows a velocity (n_q,), where it has torque. Raises: SimulationError."""
        self.physics.step(command, self._torque)

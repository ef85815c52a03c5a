"""A hand at the tool that a user moves while the arm runs; it pulls as the operator's does."""

import numpy as np

from proxcgal.core.typing import Array
from proxcgal.scenario.walkthrough_keys import HandKeys
from proxcgal.trial.walkthrough.operator_hand import HandImpedance

HAND = "hand at the tool"  #: its name, beside those of solids
SPEED = 2.0  #: [m/s] at most: above what a guard lets an arm do
ACCELERATION = 10.0  #: [m/s^2] at most: a hand that is dragged by leaps pulls without jolts
_STIFFNESS = 10.0  # [rad/s] by which it goes where it is wanted, critically damped


class InteractiveHand:
    """Holds the tool from its first `move` until it lets go or the arm stops."""

    def __init__(self, keys: HandKeys, period: float) -> None:
        """Args: `keys` of its spring and damper; one step takes `period` [s]."""
        self._keys = keys
        self._period = period
        self._pull = HandImpedance(keys, period)
        self.pose: Array | None = None  #: (4, 4) T_W of the hand; None where it holds nothing
        self._wanted = np.eye(4)
        self._twist = np.zeros(6)

    def move(self, tool: Array, wanted: Array) -> None:
        """Takes the tool, where it does not hold it yet, and says where the hand is to go.

        Args:
            tool: (4, 4) T_WT where the tool is.
            wanted: (4, 4) of the hand; it turns at once, and goes there at bounded speed.
        """
        if self.pose is None:
            self.pose = np.array(tool)
            self._pull = HandImpedance(self._keys, self._period)
            self._twist[:] = 0.0
        self._wanted = np.array(wanted)

    def let_go(self) -> None:
        """Pulls no more."""
        self.pose = None

    def force(self, position: Array, rotation: Array, twist: Array) -> Array:
        """One step: what it does at the tool's origin (6,), in world [N], [N m].

        Args:
            position: (3,) of the tool [m].
            rotation: (3, 3) R_WT.
            twist: (6,) of the tool, linear first [m/s], [rad/s].
        """
        if self.pose is None:
            return np.zeros(6)
        self._advance(self.pose)
        return self._pull.force(
            (position, rotation, twist), self.pose[:3, 3], self.pose[:3, :3], self._twist
        )

    def _advance(self, pose: Array) -> None:
        velocity = self._twist[:3]
        change = _STIFFNESS**2 * (self._wanted[:3, 3] - pose[:3, 3])
        change -= 2.0 * _STIFFNESS * velocity
        velocity += self._period * change * _share(change, ACCELERATION)
        velocity *= _share(velocity, SPEED)
        pose[:3, 3] += self._period * velocity
        pose[:3, :3] = self._wanted[:3, :3]

    def feel_stop(self) -> None:
        """The arm does not follow, for one more step: after the reaction time it lets go."""
        self._pull.feel_stop()
        if self._pull.gone:
            self.let_go()


def _share(vector: Array, most: float) -> float:
    """Of a vector that is no longer than that."""
    return min(1.0, most / max(float(np.linalg.norm(vector)), 1e-12))

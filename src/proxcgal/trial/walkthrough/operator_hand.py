"""A hand on the handle: a simulated operator's, which trembles and reacts slowly, or a user's."""

import math

import numpy as np

from proxcgal.core.transforms import rotation_from_vector, sine_axis_between
from proxcgal.core.typing import Array
from proxcgal.scenario.walkthrough_keys import HandKeys
from proxcgal.trial.walkthrough.intended_path import IntendedPath

_TREMOR_HZ = (8.0, 12.0)
_TONES = 6  # sinusoids of random frequency and phase that make a tremor
_LETTING_GO = 0.10  # [s] in which a hand that has noticed the stop lets go

HAND = "hand at the tool"  #: its name, beside those of solids
SPEED = 2.0  #: [m/s] at most: above what a guard lets an arm do
ACCELERATION = 10.0  #: [m/s^2] at most: a hand that is dragged by leaps pulls without jolts
_STIFFNESS = 10.0  # [rad/s] by which it goes where it is wanted, critically damped


class HandImpedance:
    """Spring and damper between the tool and where a hand wants it, bounded.

    Once the arm has stopped it goes on for the reaction time, and then lets go.
    """

    def __init__(self, keys: HandKeys, period: float) -> None:
        """Args: one step takes `period` [s]."""
        self._keys = keys
        self._period = period
        self.delay = round(keys.reaction_time / period)  #: steps of the reaction time
        self._stopped_for = 0
        self._force = np.zeros(6)

    @property
    def gone(self) -> bool:
        """Has it let go, after a stop?"""
        return self._held() <= 0.0

    def force(
        self,
        tool: tuple[Array, Array, Array],
        position: Array,
        rotation: Array,
        twist: Array,
        extra: Array | None = None,
    ) -> Array:
        """What it does at the tool's origin (6,), in world [N], [N m]; reused, copy what you keep.

        Args:
            tool: where that is: (3,) [m], (3, 3) R_WT, (6,) twist, linear first [m/s], [rad/s].
            position: (3,) where it is wanted [m].
            rotation: (3, 3) R_WT wanted.
            twist: (6,) of what is wanted [m/s], [rad/s].
            extra: (3,) beside spring and damper [N].
        """
        keys, force = self._keys, self._force
        force[:3] = keys.stiffness * (position - tool[0])
        force[:3] += keys.damping * (twist[:3] - tool[2][:3])
        if extra is not None:
            force[:3] += extra
        force[3:] = keys.turn_stiffness * sine_axis_between(tool[1], rotation)
        force[3:] += keys.turn_damping * (twist[3:] - tool[2][3:])
        _bound(force[:3], keys.max_force)
        _bound(force[3:], keys.max_torque)
        if self._stopped_for > self.delay:
            force *= max(self._held(), 0.0)
        return force

    def feel_stop(self) -> None:
        """The arm does not follow, for one more step."""
        self._stopped_for += 1

    def _held(self) -> float:
        """Share of the force that a hand has left which notices a stop."""
        return 1.0 - (self._stopped_for - self.delay) * self._period / _LETTING_GO


class OperatorHand:
    """Pulls the tool along an intended path; lets go of an arm that it feels has stopped."""

    def __init__(
        self, keys: HandKeys, path: IntendedPath, start: Array, period: float, seed: int
    ) -> None:
        """Args: `start` (4, 4) T_WT where the path begins; the seed fixes the tremor."""
        self._pull = HandImpedance(keys, period)
        self._path = path
        self._start = np.array(start)
        self._twist = np.zeros(6)
        self._tremor = _tremor(len(path) + self._pull.delay, period, keys.tremor, seed)

    @property
    def cycles(self) -> int:
        """From the signal to start until the path's end."""
        return len(self._path) + self._pull.delay

    def force(self, cycle: int, position: Array, rotation: Array, twist: Array) -> Array:
        """What it does at the tool's origin (6,), in world [N], [N m].

        Args:
            cycle: since the signal to start.
            position: (3,) of the tool [m].
            rotation: (3, 3) R_WT.
            twist: (6,) of the tool, linear first [m/s], [rad/s].
        """
        path = self._path
        row = min(max(cycle - self._pull.delay, 0), len(path) - 1)
        self._twist[:3], self._twist[3:] = path.velocity[row], path.spin[row]
        return self._pull.force(
            (position, rotation, twist), self._start[:3, 3] + path.position[row],
            rotation_from_vector(path.turn[row]) @ self._start[:3, :3], self._twist,
            self._tremor[min(cycle, len(self._tremor) - 1)],
        )  # fmt: skip

    def feel_stop(self) -> None:
        """The arm does not follow, for one more cycle."""
        self._pull.feel_stop()


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


def _bound(vector: Array, most: float) -> None:
    length = math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    if length > most:
        vector *= most / length


def _tremor(cycles: int, period: float, rms: float, seed: int) -> Array:
    """(n, 3) [N] of 8 to 12 Hz."""
    generator = np.random.default_rng([seed, 8])
    time = period * np.arange(cycles)
    hertz = generator.uniform(*_TREMOR_HZ, (_TONES, 3))
    phase = generator.uniform(0.0, 2.0 * np.pi, (_TONES, 3))
    tones = np.sin(2.0 * np.pi * hertz * time[:, None, None] + phase)
    return np.asarray(rms * math.sqrt(2.0 / _TONES) * tones.sum(axis=1))

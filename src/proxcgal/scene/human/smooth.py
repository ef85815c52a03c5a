"""Smooth motion between rests: position, speed and acceleration are continuous throughout."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from proxcgal.core.typing import Array

PEAK_SPEED = 1.875  # of a minimum-jerk motion, over its mean speed
PEAK_ACCELERATION = 5.7735  # over length / duration^2


def minimum_jerk(share: Array) -> Array:
    """0 to 1 over a share of the time from 0 to 1, constant outside (Flash and Hogan 1985)."""
    u = np.clip(share, 0.0, 1.0)
    return np.asarray(u**3 * (10.0 + u * (6.0 * u - 15.0)))


def least_duration(length: float, speed: float, acceleration: float) -> float:
    """Of a minimum-jerk motion that keeps both bounds [s]."""
    return max(PEAK_SPEED * length / speed, math.sqrt(PEAK_ACCELERATION * length / acceleration))


@dataclass(frozen=True, slots=True)
class Glide:
    """A way from rest to rest: speeds up, goes on at its speed, slows down."""

    start: float  #: [s]
    ramp: float  #: [s] of speeding up, and of slowing down
    cruise: float  #: [s] between

    @classmethod
    def of(cls, start: float, length: float, speed: float, acceleration: float) -> Self:
        """The fastest within bounds; too short a way is a minimum-jerk motion."""
        ramp = PEAK_SPEED * speed / acceleration
        if length >= ramp * speed:
            return cls(start, ramp, (length - ramp * speed) / speed)
        return cls(start, 0.0, max(least_duration(length, speed, acceleration), 1e-3))

    @property
    def end(self) -> float:
        """When it rests again [s]."""
        return self.start + self.cruise + 2.0 * self.ramp

    def share(self, time: Array) -> Array:
        """Of the way, 0 to 1, at these times [s]."""
        if self.ramp == 0.0:
            return minimum_jerk((time - self.start) / self.cruise)
        # Way while the speed rises like minimum_jerk: its integral, 1/2 at the ramp's end.
        passed = time - self.start
        up = _ramp_way(passed / self.ramp)
        down = _ramp_way((passed - self.ramp - self.cruise) / self.ramp)
        return np.asarray(self.ramp * (up - down) / (self.cruise + self.ramp))


def _ramp_way(share: Array) -> Array:
    u = np.clip(share, 0.0, 1.0)
    return u**4 * (2.5 + u * (u - 3.0)) + np.maximum(share - 1.0, 0.0)


class Track:
    """A value that rests, and changes by minimum-jerk steps, which may overlap."""

    def __init__(self, value: float) -> None:
        """Args: `value` is where it rests at first."""
        self._first = value
        self._steps: list[tuple[float, float, float]] = []
        self.last = value  #: where it rests in the end

    def go(self, start: float, duration: float, value: float) -> float:
        """Goes there from its last rest; the time when it is there [s]."""
        self._steps.append((start, duration, value - self.last))
        self.last = value
        return start + duration

    def at(self, time: Array) -> Array:
        """(n,) its value at these times (n,) [s]."""
        value = np.full(len(time), self._first)
        for start, duration, change in self._steps:
            value += change * minimum_jerk((time - start) / duration)
        return value


def slerp(start: Array, end: Array, share: Array) -> Array:
    """(n, 3) unit vectors on the shorter arc between unit vectors (3,) or (n, 3)."""
    cosine = np.clip((start * end).sum(axis=-1), -1.0, 1.0)
    angle = np.broadcast_to(np.arccos(cosine), share.shape)
    sine = np.sin(angle)
    small = sine < 1e-6
    safe = np.where(small, 1.0, sine)
    a = np.where(small, 1.0 - share, np.sin((1.0 - share) * angle) / safe)
    b = np.where(small, share, np.sin(share * angle) / safe)
    mixed = a[:, None] * start + b[:, None] * end
    return np.asarray(mixed / np.linalg.norm(mixed, axis=1, keepdims=True))


def two_bones(root: Array, tip: Array, upper: float, lower: float, pole: Array) -> Array:
    """(n, 3) middle joint of two bones from `root` to `tip` (n, 3), bent towards `pole` [m].

    Where the tip is out of reach, the bones are stretched towards it.
    """
    along = tip - root
    distance = np.linalg.norm(along, axis=1, keepdims=True)
    along = along / np.maximum(distance, 1e-9)
    reach = np.clip(distance, abs(upper - lower), upper + lower)
    lengthwise = (reach**2 + upper**2 - lower**2) / (2.0 * np.maximum(reach, 1e-9))
    aside = pole - (pole * along).sum(axis=1, keepdims=True) * along
    aside /= np.maximum(np.linalg.norm(aside, axis=1, keepdims=True), 1e-9)
    height = np.sqrt(np.maximum(upper**2 - lengthwise**2, 0.0))
    return np.asarray(root + lengthwise * along + height * aside)

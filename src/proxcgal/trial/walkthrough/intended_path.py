"""The path an operator has in mind, cycle by cycle."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from proxcgal.core.typing import Array
from proxcgal.scenario.walkthrough_keys import LegKeys


@dataclass(frozen=True, eq=False)
class IntendedPath:
    """Where the tool should be, n cycles long."""

    position: Array  #: (n, 3) [m] from the start, base axes
    velocity: Array  #: (n, 3) [m/s]
    turn: Array  #: (n, 3) [rad] rotation vector from the start, base axes
    spin: Array  #: (n, 3) [rad/s] its rate: the angular velocity where the axis stays

    @classmethod
    def of(cls, legs: Sequence[LegKeys], period: float) -> Self:
        """Leg after leg, each from rest to rest."""
        here, turned = np.zeros(3), np.zeros(3)
        parts: list[Array] = [np.zeros((1, 12))]
        for leg in legs:
            there, turn = np.array(leg.to), np.array(leg.turn)
            way, angle = there - here, turn - turned
            share, rate = _profile(
                float(np.linalg.norm(way)), float(np.linalg.norm(angle)), leg, period
            )
            moving = [
                here + share[:, None] * way, rate[:, None] * way,
                turned + share[:, None] * angle, rate[:, None] * angle,
            ]  # fmt: skip
            waiting = np.tile(np.r_[there, np.zeros(3), turn, np.zeros(3)], (1, 1))
            parts += [np.hstack(moving), np.repeat(waiting, round(leg.wait / period), axis=0)]
            here, turned = there, turn
        rows = np.concatenate(parts)
        return cls(rows[:, :3], rows[:, 3:6], rows[:, 6:9], rows[:, 9:])

    def __len__(self) -> int:
        """Cycles."""
        return len(self.position)


def _profile(way: float, angle: float, leg: LegKeys, period: float) -> tuple[Array, Array]:
    """Share of the leg done, and its rate [1/s]: smooth ramps, and full speed between."""
    fastest = min(
        leg.speed / way if way > 0 else np.inf, leg.turn_speed / angle if angle > 0 else np.inf
    )
    if not np.isfinite(fastest):
        return np.empty(0), np.empty(0)
    fastest = min(fastest, 1.0 / leg.ramp)  # too short for full speed
    duration = leg.ramp + 1.0 / fastest
    time = period * np.arange(1, int(np.ceil(duration / period)) + 1)
    time = np.minimum(time, duration)
    rising = np.minimum(time, leg.ramp)
    falling = np.minimum(duration - time, leg.ramp)
    w = np.pi / leg.ramp
    done = 0.5 * (rising - np.sin(w * rising) / w)
    left = 0.5 * (falling - np.sin(w * falling) / w)
    middle = np.clip(time - leg.ramp, 0.0, duration - 2 * leg.ramp)
    share = fastest * np.where(time < duration - leg.ramp, done + middle, 0.0)
    share = np.where(time < duration - leg.ramp, share, 1.0 - fastest * left)
    rate = 0.5 * fastest * (1.0 - np.cos(w * np.minimum(rising, falling)))
    return share, rate

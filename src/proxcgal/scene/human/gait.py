"""Steps: feet that stand still while the body passes over them, then swing to their next place."""

from dataclasses import dataclass

import numpy as np

from proxcgal.core.typing import Array
from proxcgal.scene.human.smooth import minimum_jerk

TURN_M = 0.20  # [m] of way that a turn of 1 rad counts as
LIFT = 0.05  # [m] height of a swinging foot
EASE = 0.30  # [s] before and after the body moves, for its first and last foot
SIDES = (1.0, -1.0)  # left, right


@dataclass(frozen=True, slots=True)
class Walk:
    """One stretch of time in which the body goes from rest to rest."""

    start: float  #: [s]
    end: float  #: [s]

    def stride(self, time: Array) -> Array:
        """(n,) 0 standing, 1 walking."""
        begun = minimum_jerk((time - self.start + EASE) / (2.0 * EASE))
        return np.asarray(begun - minimum_jerk((time - self.end + EASE) / (2.0 * EASE)))


def feet(
    time: Array, walks: list[Walk], body: Array, yaw: Array, apart: float, step: float
) -> Array:
    """(2, n, 3) left and right foot against the floor [m].

    Args:
        time: (n,) [s].
        walks: in their order, at least 2 EASE apart.
        body: (n, 2) midway between the feet, wherever it rests [m].
        yaw: (n,) facing [rad].
        apart: of each foot from the middle [m].
        step: length of one, at most [m].
    """
    out = np.zeros((2, len(time), 3))
    rate = np.hypot(*np.gradient(body, axis=0).T) + TURN_M * np.abs(np.gradient(yaw))
    passed = np.cumsum(rate)
    for row, side in enumerate(SIDES):
        out[row, :, :2] = _beside(body[:1], yaw[:1], side * apart)
    for walk in walks:
        inside = np.flatnonzero((time >= walk.start - EASE) & (time <= walk.end + EASE))
        if not len(inside):
            continue
        after = np.arange(len(time)) > inside[-1]
        way = passed[inside] - passed[inside[0]]
        share = way / max(way[-1], 1e-12)
        between = max(int(np.ceil(way[-1] / step)), 1)  # steps, the first and last being halves
        phase = between * share
        for edge in (walk.start, walk.end):
            phase += 0.5 * minimum_jerk((time[inside] - edge + EASE) / (2.0 * EASE))
        for row, side in enumerate(SIDES):
            here = out[row, inside[0], :2].copy()
            spots = _beside(body[inside], yaw[inside], side * apart)
            for swing in range(row, between + 1, 2):
                # It stands until its next swing: in the middle of that the body is above it.
                above = np.clip((swing + 1.0) / between, 0.0, 1.0)
                at = int(np.searchsorted(share, above - 1e-9))
                there = spots[min(at, len(spots) - 1)]
                done = phase - swing
                out[row, inside, :2] += (there - here) * minimum_jerk(done)[:, None]
                u = np.clip(done, 0.0, 1.0)
                out[row, inside, 2] += LIFT * 64.0 * (u * (1.0 - u)) ** 3
                here = there
            out[row, after, :2] = here
    return out


def _beside(body: Array, yaw: Array, offset: float) -> Array:
    """(n, 2) this far to the left of the middle [m]."""
    return body + offset * np.stack([-np.sin(yaw), np.cos(yaw)], axis=1)

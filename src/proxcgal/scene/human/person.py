"""A person as a scene: capsules, and where they are and how they move at any time."""

from functools import lru_cache

import numpy as np

from proxcgal.core.typing import Array
from proxcgal.scene.human import body
from proxcgal.scene.human.motion import Motion, move
from proxcgal.scene.human.operator_keys import Operator
from proxcgal.scene.human.recorded import read_motion
from proxcgal.scene.human.subject import draw_subject
from proxcgal.scene.solids import CapsuleSolid, Solid


class Person:
    """A body in motion; before its motion begins and after it ends it stands still.

    Between two moments of the motion, points go straight and evenly from one place to the next.
    """

    still = False

    def __init__(self, motion: Motion) -> None:
        """Lays the capsules out over the whole motion."""
        thickness = body.radii(motion.stature)
        self._time = motion.time
        self._start, self._end = body.segments(motion.points_W, thickness)
        # What is measured of a living body changes a little in length; a capsule does not.
        lengths = np.median(np.linalg.norm(self._end - self._start, axis=2), axis=0)
        self.names: tuple[str, ...] = body.NAMES
        self.solids: tuple[Solid, ...] = tuple(
            CapsuleSolid(float(radius), float(length))
            for radius, length in zip(thickness, lengths, strict=True)
        )
        self._poses = body.poses(self._start, self._end)
        self._start_speed = np.gradient(self._start, self._time, axis=0)
        self._end_speed = np.gradient(self._end, self._time, axis=0)

    def poses(self, time: float) -> Array:
        """(parts, 4, 4) T_WO of every capsule."""
        row, share = self._place(time)
        if share == 0.0:
            return np.asarray(self._poses[row])
        start = (1.0 - share) * self._start[row] + share * self._start[row + 1]
        return body.poses(start, (1.0 - share) * self._end[row] + share * self._end[row + 1])

    def twists(self, time: float) -> Array:
        """(parts, 6) velocity of every capsule's middle [m/s], angular velocity [rad/s]; in world.

        A capsule's turning about its own axis is left out: it moves no surface.
        """
        row, share = self._place(time)
        if time < self._time[0] or time > self._time[-1]:
            return np.zeros((len(self.names), 6))
        after = min(row + 1, len(self._time) - 1)

        def between(values: Array) -> Array:
            return np.asarray((1.0 - share) * values[row] + share * values[after])

        along = between(self._end) - between(self._start)
        start, end = between(self._start_speed), between(self._end_speed)
        length2 = np.maximum((along * along).sum(axis=1, keepdims=True), 1e-12)
        turning = np.cross(along, end - start) / length2
        return np.hstack([0.5 * (start + end), turning])

    def _place(self, time: float) -> tuple[int, float]:
        """The moment at or before a time, and the share of the way to the next."""
        last = len(self._time) - 1
        row = int(np.searchsorted(self._time, time + 1e-9, side="right")) - 1
        if row < 0 or row >= last:
            return min(max(row, 0), last), 0.0
        share = (time - self._time[row]) / (self._time[row + 1] - self._time[row])
        return row, float(share) if share > 1e-6 else 0.0


@lru_cache(maxsize=4)
def _person(operator: str, duration: float) -> Person:
    settings = Operator.model_validate_json(operator, strict=False)
    if settings.recording is not None:
        return Person(read_motion(settings.recording))
    return Person(move(draw_subject(settings.subject, settings.draw), settings, duration))


def person_of(operator: Operator, duration: float) -> Person:
    """The person of a scenario, made once a process for the trials that share it.

    Raises:
        ConfigError: a recording that cannot be read; a place that the subject cannot reach.
    """
    return _person(operator.model_dump_json(), duration)

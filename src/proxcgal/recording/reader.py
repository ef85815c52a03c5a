"""Reads a recording back: every tick up to the first damage, and where that is."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.writer import MCAP0_MAGIC

from proxcgal.core.errors import RecordingError
from proxcgal.core.typing import Array
from proxcgal.recording.damage import Contents
from proxcgal.recording.foxglove import points_of
from proxcgal.recording.writer import Settings
from proxcgal.sim.clouds import Clouds
from proxcgal.sim.tick import Tick

_LONGEST_STEP = 1.0  # [s] from tick to tick; beyond, the clock has jumped
_SAME_STEP = 1e-6  # [s] a simulator's ticks are as even as that


@dataclass(frozen=True)
class Recording:
    """What a file holds."""

    path: Path
    settings: Settings
    ticks: tuple[Tick, ...]
    damage: str | None  #: where and why reading ended early; None for a whole file
    #: Of each tick, the messages of the kept and the removed cloud that were written last; none
    #: where a tick comes before any, and in older recordings.
    cloud_messages: tuple[tuple[bytes, bytes] | None, ...] = ()

    @property
    def has_clouds(self) -> bool:
        """Does it hold the clouds of every tick? They were written at the sensors' rate."""
        return bool(self.cloud_messages) and self.cloud_messages[0] is not None

    def clouds(self, row: int) -> Clouds | None:
        """What the filter made of the points up to that tick; None where it is not recorded."""
        messages = self.cloud_messages[row] if self.has_clouds else None
        return None if messages is None else Clouds(*map(points_of, messages))

    def elapsed(self) -> Array:
        """(n,) [s] since the first tick, whatever clock the ticks were stamped by.

        Where that clock jumps, as a fault makes it, a period counts instead. Of a recording that
        holds ticks with scans only, the run's own time.
        """
        times: Array = np.array([tick.inputs.time for tick in self.ticks])
        if self.settings.ticks != "all":
            return times
        if len(times) < 2:
            return np.zeros(len(times))
        period = 1.0 / self.settings.scenario.simulation.control_hz
        steps = np.diff(times)
        steps[(steps <= 0.0) | (steps > _LONGEST_STEP)] = period
        if np.abs(steps - period).max() < _SAME_STEP:
            return np.arange(len(times), dtype=np.float64) * period
        return np.concatenate(([0.0], np.cumsum(steps)))

    def postures(self) -> Iterator[Array]:
        """(n_q,) of each tick, to draw: the last finite one where a joint state is no number."""
        q = np.array(self.settings.scenario.start()[1])
        for tick in self.ticks:
            q = tick.inputs.q if np.isfinite(tick.inputs.q).all() else q
            yield q


def read_recording(path: str | Path) -> Recording:
    """Reads all ticks up to the first damage.

    Raises:
        RecordingError: no recording of proxcgal, or one damaged before its first tick's settings
            end; with the path and what was expected.
    """
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RecordingError(f"recording {path}: cannot be read: {error.strerror}") from None
    if not data.startswith(MCAP0_MAGIC):
        raise RecordingError(
            f"recording {path}: not a recording: an MCAP file was expected, which begins with "
            f"{MCAP0_MAGIC!r}, not with {data[: len(MCAP0_MAGIC)]!r}"
        )
    found = Contents(path, data)
    return Recording(path, found.settings(), tuple(found.ticks), found.damage, tuple(found.clouds))

"""The durable record of a teaching: every pose, readable after `kill -9`.

Each pose holds its own checksum, and reading gives all up to the first damage.
"""

import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.exceptions import McapError
from mcap.records import Message, Metadata
from mcap.stream_reader import StreamReader

from proxcgal.core.errors import RecordingError
from proxcgal.core.provenance import versions
from proxcgal.core.typing import Array
from proxcgal.recording.foxglove import nanoseconds
from proxcgal.recording.mcap_file import SETTINGS, McapFile

TOPIC = "/pose"
_SCHEMA = {
    "type": "object",
    "title": "proxcgal.TaughtPose",
    "description": "time [s], q [rad], position [m] and rotation (row by row) of the tool in the "
    "base frame, force [N], [N m] of the hand, torque (the STO signal)",
}


class PoseRecorder(McapFile):
    """Writes one teaching."""

    def __init__(self, path: str | Path, about: Mapping[str, str]) -> None:
        """Opens the file and writes what it is of.

        Args:
            path: of the file.
            about: metadata beside the poses: the scenario, the seed.

        Raises:
            ConfigError: it cannot be written.
        """
        super().__init__(path)
        try:
            settings = {**about, "versions": json.dumps(versions())}
            self.begin("proxcgal teaching", {TOPIC: _SCHEMA}, settings)
            self.flush()
        except OSError as error:
            raise self.unwritable(error) from None

    def write(
        self, time: float, q: Array, tool_W: Array, tool_R: Array, force: Array, torque: bool
    ) -> None:
        """Writes a pose; once this returns without `failure`, it can be read back."""
        if self.failure is not None:
            return
        body = json.dumps(
            {
                "time": time, "q": q.tolist(), "position": tool_W.tolist(),
                "rotation": tool_R.ravel().tolist(), "force": force.tolist(), "torque": torque,
            },
            separators=(",", ":"),
        ).encode()[:-1]  # fmt: skip
        with self.guarded():
            self.message(TOPIC, nanoseconds(time), body + b',"crc":%d}' % zlib.crc32(body))
            self.flush()


@dataclass(frozen=True, eq=False)
class RecordedPoses:
    """What a file holds."""

    path: Path
    about: Mapping[str, str]
    time: Array  #: (n,) [s]
    q: Array  #: (n, n_q) [rad]
    damage: str | None  #: why reading ended early; None for a whole file


def read_poses(path: str | Path) -> RecordedPoses:
    """Reads all poses up to the first damage.

    Raises:
        RecordingError: no record of a teaching, or not one whole pose in it.
    """
    path = Path(path)
    about: Mapping[str, str] | None = None
    rows: list[dict[str, object]] = []
    damage: str | None = None
    try:
        with path.open("rb") as stream:
            try:
                for record in StreamReader(stream, emit_chunks=True).records:
                    if isinstance(record, Metadata) and record.name == SETTINGS:
                        about = dict(record.metadata)
                    elif isinstance(record, Message):
                        rows.append(_row(record, len(rows)))
            except (McapError, ValueError, KeyError, EOFError) as error:
                damage = f"after pose {len(rows)}: {error or type(error).__name__}"
    except OSError as error:
        raise RecordingError(f"recording {path}: cannot be read: {error.strerror}") from None
    if about is None or not rows:
        raise RecordingError(
            f"recording {path}: holds no poses of a teaching" + (f": {damage}" if damage else "")
        )

    time, q = (np.array([row[name] for row in rows], np.float64) for name in ("time", "q"))
    return RecordedPoses(path, about, time, q, damage)


def _row(message: Message, number: int) -> dict[str, object]:
    body, mark, crc = message.data.rpartition(b',"crc":')
    if message.sequence != number or not mark or crc != b"%d}" % zlib.crc32(body):
        raise ValueError("its checksum does not fit")
    content: dict[str, object] = json.loads(message.data)
    return content

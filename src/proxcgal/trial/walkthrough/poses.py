"""The durable record of what was taught: every pose, readable after `kill -9`.

An MCAP file without chunks, flushed after every pose; each holds its own checksum, and reading
gives all up to the first damage.
"""

from __future__ import annotations

import json
import warnings
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.exceptions import McapError
from mcap.records import Message, Metadata
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType, Writer

from proxcgal.core.closing import Closing
from proxcgal.core.errors import ConfigError, RecordingError
from proxcgal.core.provenance import versions
from proxcgal.core.typing import Array, Bools
from proxcgal.recording.foxglove import nanoseconds

PROFILE = "proxcgal"
TOPIC, SETTINGS = "/pose", "proxcgal"
_SCHEMA = {
    "type": "object",
    "title": "proxcgal.TaughtPose",
    "description": "time [s], q [rad], position [m] and rotation (row by row) of the tool in the "
    "base frame, force [N], [N m] of the hand, torque (the STO signal)",
}


class PoseRecorder(Closing):
    """Writes one teaching. A full disk stops the recording, with a warning, but never the run."""

    def __init__(self, path: str | Path, about: Mapping[str, str]) -> None:
        """Opens the file and writes what it is of.

        Args:
            path: of the file.
            about: kept beside the poses: the scenario, the seed.

        Raises:
            ConfigError: it cannot be written.
        """
        self.path = Path(path)
        self.failure: str | None = None  #: why it stopped early
        self._count = 0
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._stream = self.path.open("wb")
            self._writer = Writer(
                self._stream, use_chunking=False, compression=CompressionType.NONE,
                index_types=IndexType.ALL, enable_data_crcs=True,
            )  # fmt: skip
            self._writer.start(PROFILE, "proxcgal teaching")
            schema = self._writer.register_schema(
                _SCHEMA["title"], "jsonschema", json.dumps(_SCHEMA).encode()
            )
            self._channel = self._writer.register_channel(TOPIC, "json", schema)
            self._writer.add_metadata(SETTINGS, {**about, "versions": json.dumps(versions())})
            self._stream.flush()
        except OSError as error:
            reason = error.strerror or error
            raise ConfigError(f"recording {self.path}: cannot be written: {reason}") from None

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
        data = body + b',"crc":%d}' % zlib.crc32(body)
        stamp = nanoseconds(time)
        try:
            self._writer.add_message(self._channel, stamp, data, stamp, self._count)
            self._stream.flush()
            self._count += 1
        except OSError as error:
            self._fail(error)

    def close(self) -> None:
        """Writes the index and closes the file."""
        try:
            if self.failure is None:
                self._writer.finish()  # type: ignore[no-untyped-call]
            self._stream.close()
        except OSError as error:
            self._fail(error)

    def _fail(self, error: OSError) -> None:
        if self.failure is not None:
            return
        self.failure = f"recording {self.path} stopped: {error.strerror}"
        warnings.warn(self.failure, RuntimeWarning, stacklevel=4)


@dataclass(frozen=True, eq=False)
class TaughtPoses:
    """What a file holds."""

    path: Path
    about: Mapping[str, str]
    time: Array  #: (n,) [s]
    q: Array  #: (n, n_q) [rad]
    position_W: Array  #: (n, 3) [m] of the tool
    rotation_WT: Array  #: (n, 3, 3)
    force: Array  #: (n, 6) [N], [N m]
    torque: Bools  #: (n,)
    damage: str | None  #: why reading ended early; None for a whole file


def read_poses(path: str | Path) -> TaughtPoses:
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

    def column(name: str) -> Array:
        return np.array([row[name] for row in rows], np.float64)

    return TaughtPoses(
        path, about, column("time"), column("q"), column("position"),
        column("rotation").reshape(-1, 3, 3), column("force"),
        np.array([row["torque"] for row in rows], np.bool_), damage,
    )  # fmt: skip


def _row(message: Message, number: int) -> dict[str, object]:
    body, mark, crc = message.data.rpartition(b',"crc":')
    if message.sequence != number or not mark or crc != b"%d}" % zlib.crc32(body):
        raise ValueError("its checksum does not fit")
    content: dict[str, object] = json.loads(message.data)
    return content

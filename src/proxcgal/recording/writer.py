"""The durable log of one run: an MCAP file that Foxglove opens and a replay repeats bit for bit.

No chunks, and a flush after every tick: what was acknowledged survives `kill -9`. Every tick holds
the checksum of the whole file before it, so that damage is found, wherever it is, and told.
"""

from __future__ import annotations

import io
import json
import warnings
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, BinaryIO, Literal, cast

import numpy as np
from mcap.writer import CompressionType, IndexType, Writer

from proxcgal.core.closing import Closing
from proxcgal.core.errors import ConfigError
from proxcgal.core.provenance import versions
from proxcgal.core.typing import Array
from proxcgal.recording import codec, foxglove
from proxcgal.scenario.scenario import Scenario
from proxcgal.scene.obstacles import Scene
from proxcgal.sim.tick import Tick

#: Every tick, which a replay repeats bit for bit; or, to step through, those that brought scans.
RecordedTicks = Literal["all", "scans"]

PROFILE = "proxcgal"
FORMAT = "1"
TICKS, SETTINGS, KNOWN_POINTS = "/tick", "proxcgal", "known_points_W.npy"
_TICK_SCHEMA = {
    "type": "object",
    "title": "proxcgal.Tick",
    "description": "Inputs and outputs of one tick; docs/scenarios.md has the fields.",
}


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What a run was made with."""

    scenario: Scenario
    controller: str  #: one of CONTROLLERS
    seed: int
    meshes: Mapping[str, str]  #: SHA-256 of each link's two meshes
    versions: Mapping[str, str] = field(default_factory=versions)
    known_points_W: Array | None = field(default=None, compare=False)  #: where the run uses them
    ticks: RecordedTicks = "all"


class Recorder(Closing):
    """Writes one run. A full disk stops the recording, with a warning, but never the run."""

    def __init__(self, path: str | Path, ticks: RecordedTicks = "all") -> None:
        """Tries the place at once, so that a bad one is told before anything is computed.

        What an older file of that name holds stays until the run starts.

        Args:
            path: of the file.
            ticks: which of them whoever runs the trial is to write.

        Raises:
            ConfigError: the folder cannot be made or the file not be written.
        """
        self.path = Path(path)
        self.ticks: RecordedTicks = ticks
        self.failure: str | None = None  #: why it stopped early
        self.started = False
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._is_new = not self.path.exists()
            self._stream = _Checked(self.path.open("ab"))
        except OSError as error:
            reason = error.strerror or error
            raise ConfigError(f"recording {self.path}: cannot be written: {reason}") from None
        self._channels: dict[str, int] = {}
        self._count = 0

    def start(self, settings: Settings) -> None:
        """Writes what the run is made with."""
        self.started = True
        try:
            self._start(settings)
        except OSError as error:
            self._fail(error)

    def write(self, tick: Tick) -> None:
        """Writes a tick; once this returns without `failure`, the tick can be read back."""
        if self.failure is None:
            try:
                data = codec.encode(tick, self._stream.crc)
                self._message(TICKS, tick.inputs.time, data)
                self._stream.flush()
            except OSError as error:
                self._fail(error)

    def show(
        self,
        time: float,
        cloud_W: Array,
        links: Sequence[str],
        poses_W: Array,
        arrow: tuple[Sequence[float] | None, Sequence[float] | None],
    ) -> None:
        """Writes what Foxglove draws: the filtered cloud, the links' frames, the closest pair."""
        if self.failure is None:
            try:
                self._message("/cloud", time, foxglove.point_cloud(time, cloud_W))
                self._message("/links", time, foxglove.frame_transforms(time, links, poses_W))
                self._message("/scene", time, foxglove.pair_arrow(time, *arrow))
            except OSError as error:
                self._fail(error)

    def show_scene(self, time: float, scene: Scene, elapsed: float) -> None:
        """Writes where the scene's solids are at `elapsed` [s], for Foxglove."""
        if self.failure is None:
            try:
                named = zip(scene.names, scene.solids, scene.poses(elapsed), strict=True)
                self._message("/scene", time, foxglove.solids(time, list(named)))
            except OSError as error:
                self._fail(error)

    def close(self) -> None:
        """Writes the index and closes the file; a new one of a run that never began is removed."""
        try:
            if self.started and self.failure is None:
                self._writer.finish()  # type: ignore[no-untyped-call]
            self._stream.close()
        except OSError as error:
            self._fail(error)
        if self._is_new and not self.started:
            self.path.unlink(missing_ok=True)

    def _start(self, settings: Settings) -> None:
        self._stream.close()
        self._stream = _Checked(self.path.open("wb"))
        self._writer = Writer(
            cast("IO[bytes]", self._stream), use_chunking=False, compression=CompressionType.NONE,
            index_types=IndexType.ALL, enable_data_crcs=True,
        )  # fmt: skip
        self._writer.start(PROFILE, f"proxcgal {settings.versions.get('proxcgal', '')}")
        for topic, schema in {TICKS: _TICK_SCHEMA, **foxglove.TOPICS}.items():
            number = self._writer.register_schema(
                str(schema["title"]), "jsonschema", json.dumps(schema).encode()
            )
            self._channels[topic] = self._writer.register_channel(topic, "json", number)
        content = {
            "format": FORMAT,
            "scenario": settings.scenario.to_toml(),
            "controller": settings.controller,
            "seed": str(settings.seed),
            "meshes": json.dumps(dict(settings.meshes)),
            "versions": json.dumps(dict(settings.versions)),
            "ticks": settings.ticks,
        }
        self._writer.add_metadata(SETTINGS, {**content, "crc": settings_crc(content)})
        if settings.known_points_W is not None:
            points = io.BytesIO()
            np.save(points, settings.known_points_W)
            self._writer.add_attachment(0, 0, KNOWN_POINTS, "application/x-npy", points.getvalue())
        self._stream.flush()

    def _message(self, topic: str, time: float, data: bytes) -> None:
        stamp = foxglove.nanoseconds(time)
        self._writer.add_message(self._channels[topic], stamp, data, stamp, self._count)
        self._count += 1

    def _fail(self, error: OSError) -> None:
        if self.failure is not None:  # told already
            return
        self.failure = f"recording {self.path} stopped: {error.strerror}"
        warnings.warn(self.failure, RuntimeWarning, stacklevel=4)


def settings_crc(content: Mapping[str, str]) -> str:
    """Checksum of the settings, which stand before any tick."""
    text = json.dumps({key: content[key] for key in sorted(content)})
    return str(zlib.crc32(text.encode()))


class _Checked:
    """A file that knows the CRC-32 of all that was written to it."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.crc = 0

    def write(self, data: bytes) -> int:
        self.crc = zlib.crc32(data, self.crc)
        return self._file.write(data)

    def tell(self) -> int:
        return self._file.tell()

    def flush(self) -> None:
        self._file.flush()

    def close(self) -> None:
        self._file.close()

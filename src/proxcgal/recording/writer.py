"""The durable log of one run: an MCAP file that Foxglove opens and a replay repeats bit for bit.

A flush after every tick: what was acknowledged survives `kill -9`. Every tick holds the checksum of
the whole file before it, so that damage is found, wherever it is, and reported.
"""

import io
import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from proxcgal.core.provenance import versions
from proxcgal.core.typing import Array
from proxcgal.recording import codec, foxglove
from proxcgal.recording.mcap_file import McapFile
from proxcgal.scenario.scenario import Scenario
from proxcgal.scene.obstacles import Scene
from proxcgal.sim.clouds import Clouds
from proxcgal.sim.tick import Tick

#: Every tick, which a replay repeats bit for bit; or, to step through, those that brought scans.
RecordedTicks = Literal["all", "scans"]

FORMAT = "1"
TICKS, KEPT, REMOVED = "/tick", "/cloud", "/removed"
KNOWN_POINTS = "known_points_W.npy"
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


class Recorder(McapFile):
    """Writes one run."""

    def __init__(self, path: str | Path, ticks: RecordedTicks = "all") -> None:
        """Fails early if the path is not writable.

        Args:
            path: of the file; an older one of that name stays until the run starts.
            ticks: which of them the caller is to write.

        Raises:
            ConfigError: the folder cannot be made or the file not be written.
        """
        super().__init__(path)
        self.ticks: RecordedTicks = ticks

    def start(self, settings: Settings) -> None:
        """Writes what the run is made with."""
        content = {
            "format": FORMAT,
            "scenario": settings.scenario.to_toml(),
            "controller": settings.controller,
            "seed": str(settings.seed),
            "meshes": json.dumps(dict(settings.meshes)),
            "versions": json.dumps(dict(settings.versions)),
            "ticks": settings.ticks,
        }
        with self.guarded():
            self.begin(
                f"proxcgal {settings.versions.get('proxcgal', '')}",
                {TICKS: _TICK_SCHEMA, **foxglove.TOPICS},
                {**content, "crc": settings_crc(content)},
            )
            if settings.known_points_W is not None:
                points = io.BytesIO()
                np.save(points, settings.known_points_W)
                self.writer.add_attachment(
                    0, 0, KNOWN_POINTS, "application/x-npy", points.getvalue()
                )
            self.flush()

    def write(self, tick: Tick) -> None:
        """Writes a tick; once this returns without `failure`, the tick can be read back."""
        if self.failure is None:
            with self.guarded():
                self._add(TICKS, tick.inputs.time, codec.encode(tick, self.crc))
                self.flush()

    def show(
        self,
        time: float,
        clouds: Clouds,
        links: Sequence[str],
        poses_W: Array,
        arrow: tuple[Sequence[float] | None, Sequence[float] | None],
    ) -> None:
        """Writes what pictures and Foxglove draw: clouds, the links' frames, the closest pair.

        It belongs to the tick that is written next.
        """
        if self.failure is None:
            with self.guarded():
                self._add(KEPT, time, foxglove.point_cloud(time, clouds.kept_W))
                self._add(REMOVED, time, foxglove.point_cloud(time, clouds.removed_W))
                self._add("/links", time, foxglove.frame_transforms(time, links, poses_W))
                self._add("/scene", time, foxglove.arrow_update(time, *arrow))

    def show_scene(self, time: float, scene: Scene, elapsed: float) -> None:
        """Writes where the scene's solids are at `elapsed` [s], for Foxglove."""
        if self.failure is None:
            with self.guarded():
                named = zip(scene.names, scene.solids, scene.poses(elapsed), strict=True)
                self._add("/scene", time, foxglove.solids(time, list(named)))

    def _add(self, topic: str, time: float, data: bytes) -> None:
        self.message(topic, foxglove.nanoseconds(time), data)


def settings_crc(content: Mapping[str, str]) -> str:
    """Checksum of the settings, which stand before any tick."""
    return str(zlib.crc32(json.dumps(dict(content), sort_keys=True).encode()))

"""Reads a recording back: every tick up to the first damage, and where that is."""

from __future__ import annotations

import io
import json
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, DataEnd, Footer, Header, Message, Metadata
from mcap.writer import MCAP0_MAGIC

from proxcgal.core.errors import ConfigError, RecordingError
from proxcgal.core.typing import Array
from proxcgal.recording import codec
from proxcgal.recording.foxglove import nanoseconds
from proxcgal.recording.writer import (
    FORMAT,
    KNOWN_POINTS,
    PROFILE,
    SETTINGS,
    TICKS,
    Recorder,
    Settings,
    settings_crc,
)
from proxcgal.scenario.loading import parse_scenario
from proxcgal.sim.tick import Tick

__all__ = ["Recorder", "Recording", "Settings", "read_recording"]

_HEAD = 9  # opcode and length of a record
_LONGEST_STEP = 1.0  # [s] from tick to tick; beyond, the clock has jumped
_SAME_STEP = 1e-6  # [s] a simulator's ticks are as even as that
_SUMMARY_CRC = 4  # closes the footer, not part of what it covers


@dataclass(frozen=True)
class Recording:
    """What a file holds."""

    path: Path
    settings: Settings
    ticks: tuple[Tick, ...]
    damage: str | None  #: where and why reading ended early; None for a whole file

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
    found = _Contents(path, data)
    try:
        found.read()
    except _DamageError as damage:
        found.damage = str(damage)
    return found.recording()


class _DamageError(Exception):
    """Where reading has to stop."""


class _Contents:
    """What was found so far."""

    def __init__(self, path: Path, data: bytes) -> None:
        self._path = path
        self._data = data
        self._topics: dict[int, str] = {}
        self._settings: dict[str, str] | None = None
        self._known_points: Array | None = None
        self._ticks: list[Tick] = []
        self._messages = 0
        self.damage: str | None = None

    def recording(self) -> Recording:
        if self._settings is None:
            raise RecordingError(
                f"recording {self._path}: holds no settings of a run"
                + (f": {self.damage}" if self.damage else "")
            )
        content = self._settings
        try:
            settings = Settings(
                scenario=parse_scenario(content["scenario"], str(self._path)),
                controller=content["controller"],
                seed=int(content["seed"]),
                meshes=json.loads(content["meshes"]),
                versions=json.loads(content["versions"]),
                known_points_W=self._known_points,
                ticks="scans" if content.get("ticks") == "scans" else "all",
            )
        except (ConfigError, KeyError, ValueError) as error:
            raise RecordingError(f"recording {self._path}: unusable settings: {error}") from None
        return Recording(self._path, settings, tuple(self._ticks), self.damage)

    def read(self) -> None:
        """Takes record after record. Raises: _DamageError at the first one that is not whole."""
        crc, checked = 0, 0  # of the file before the record at hand
        for offset, opcode, content in self._records():
            crc, checked = zlib.crc32(self._data[checked:offset], crc), offset
            try:
                ended = self._take(opcode, content, crc)
            except RecordingError:
                raise
            except Exception as error:  # whatever a broken record makes its parser raise
                reason = str(error) or type(error).__name__
                raise _DamageError(f"{self._place(offset)}: {reason}") from None
            if ended:
                return self._check_index(offset + _HEAD + len(content))
        raise _DamageError(f"ends at byte {len(self._data)} without being closed{self._so_far()}")

    def _records(self) -> Iterator[tuple[int, int, bytes]]:
        offset = len(MCAP0_MAGIC)
        while offset < len(self._data):
            head = self._data[offset : offset + _HEAD]
            length = int.from_bytes(head[1:], "little")
            end = offset + _HEAD + length
            if len(head) < _HEAD or end > len(self._data):
                raise _DamageError(f"{self._place(offset)}: cut off at byte {len(self._data)}")
            yield offset, head[0], self._data[offset + _HEAD : end]
            offset = end

    def _take(self, opcode: int, content: bytes, crc: int) -> bool:
        """Keeps what a record holds; true for the end of the data."""
        stream = ReadDataStream(io.BytesIO(content))
        if opcode == Opcode.HEADER:
            profile = Header.read(stream).profile
            if profile != PROFILE:
                raise RecordingError(
                    f"recording {self._path}: an MCAP file, but with the profile {profile!r}, "
                    f"not {PROFILE!r}: not a recording of proxcgal"
                )
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            self._topics[channel.id] = channel.topic
        elif opcode == Opcode.METADATA:
            self._take_settings(Metadata.read(stream))
        elif opcode == Opcode.ATTACHMENT:
            attachment = Attachment.read(stream)
            if attachment.name == KNOWN_POINTS:
                self._known_points = np.load(io.BytesIO(attachment.data))
        elif opcode == Opcode.MESSAGE:
            message = Message.read(stream, len(content))
            if message.sequence != self._messages:
                raise ValueError(f"is message {message.sequence}, {self._messages} was expected")
            self._messages += 1
            if self._topics[message.channel_id] == TICKS:
                tick, before = codec.decode(message.data)
                if before != crc:
                    raise ValueError("something between it and the tick before it was changed")
                stamp = nanoseconds(tick.inputs.time)
                if (message.log_time, message.publish_time) != (stamp, stamp):
                    raise ValueError("its head was changed")
                self._ticks.append(tick)
        elif opcode == Opcode.DATA_END:
            if DataEnd.read(stream).data_section_crc != crc:
                raise ValueError("something after the last tick was changed")
            return True
        elif opcode != Opcode.SCHEMA:
            raise ValueError(f"unknown kind of record {opcode}")
        return False

    def _take_settings(self, metadata: Metadata) -> None:
        if metadata.name != SETTINGS:
            raise ValueError(f"unknown metadata {metadata.name!r}")
        content = dict(metadata.metadata)
        if not {"crc", "controller"} & content.keys():
            raise RecordingError(
                f"recording {self._path}: holds the poses of a walk-through, and no controller's "
                "ticks; path.csv beside it has the path, and Foxglove shows it"
            )
        if content.pop("crc", None) != settings_crc(content):
            raise ValueError("the settings' checksum does not fit")
        if content["format"] != FORMAT:
            raise RecordingError(
                f"recording {self._path}: has format {content['format']}, which this version "
                f"cannot read: it reads {FORMAT}"
            )
        self._settings = content

    def _check_index(self, start: int) -> None:
        """The summary behind the data: no tick depends on it, but damage is told."""
        length = _HEAD + 8 + 8 + _SUMMARY_CRC
        end = len(self._data) - len(MCAP0_MAGIC)
        footer = self._data[end - length : end]
        whole = (
            end - length >= start
            and self._data.endswith(MCAP0_MAGIC)
            and footer[0] == Opcode.FOOTER
            and Footer.read(ReadDataStream(io.BytesIO(footer[_HEAD:]))).summary_crc
            == zlib.crc32(self._data[start : end - _SUMMARY_CRC])
        )
        if not whole:
            raise _DamageError(f"in the index after byte {start}{self._so_far()}; no tick is lost")

    def _place(self, offset: int) -> str:
        return f"record at byte {offset} of {len(self._data)}{self._so_far()}"

    def _so_far(self) -> str:
        if not self._ticks:
            return ", before the first tick"
        lasts = self._ticks[-1].inputs.time - self._ticks[0].inputs.time
        return f", after {len(self._ticks)} ticks up to {lasts:.3f} s"

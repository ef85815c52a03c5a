"""Reads the records of a file up to the first damage: checksums, sequence numbers, the index."""

import io
import json
import zlib
from collections.abc import Iterator
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
from proxcgal.recording.mcap_file import PROFILE, SETTINGS
from proxcgal.recording.writer import (
    FORMAT,
    KEPT,
    KNOWN_POINTS,
    REMOVED,
    TICKS,
    Settings,
    settings_crc,
)
from proxcgal.scenario.loading import parse_scenario
from proxcgal.sim.tick import Tick

_HEAD = 9  # opcode and length of a record
_SUMMARY_CRC = 4  # closes the footer, not part of what it covers


class _DamageError(Exception):
    """Where reading has to stop."""


class Contents:
    """What a file holds before its first damage."""

    def __init__(self, path: Path, data: bytes) -> None:
        """Reads it.

        Args:
            path: of the file, for messages.
            data: its bytes, which begin as an MCAP file does.

        Raises:
            RecordingError: no recording of proxcgal.
        """
        self._path = path
        self._data = data
        self._topics: dict[int, str] = {}
        self._settings: dict[str, str] | None = None
        self._known_points: Array | None = None
        self._messages = 0
        self._shown: dict[str, bytes] = {}  # the last message of each cloud
        self.ticks: list[Tick] = []
        self.clouds: list[tuple[bytes, bytes] | None] = []  #: of each tick, kept and removed
        self.damage: str | None = None  #: where and why reading ended early
        try:
            self._read()
        except _DamageError as damage:
            self.damage = str(damage)

    def settings(self) -> Settings:
        """What the run was made with. Raises: RecordingError: there is none, or unusable."""
        if self._settings is None:
            raise RecordingError(
                f"recording {self._path}: holds no settings of a run"
                + (f": {self.damage}" if self.damage else "")
            )
        content = self._settings
        try:
            return Settings(
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

    def _read(self) -> None:
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
            end = offset + _HEAD + int.from_bytes(head[1:], "little")
            if len(head) < _HEAD or end > len(self._data):
                raise _DamageError(f"{self._place(offset)}: cut off at byte {len(self._data)}")
            yield offset, head[0], self._data[offset + _HEAD : end]
            offset = end

    def _take(self, opcode: int, content: bytes, crc: int) -> bool:
        """Keeps what a record holds; true for the end of the data."""
        stream = ReadDataStream(io.BytesIO(content))
        if opcode == Opcode.HEADER:
            if (profile := Header.read(stream).profile) != PROFILE:
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
            topic = self._topics[message.channel_id]
            if topic in (KEPT, REMOVED):
                self._shown[topic] = message.data
            elif topic == TICKS:
                tick, before = codec.decode(message.data)
                if before != crc:
                    raise ValueError("something between it and the tick before it was changed")
                stamp = nanoseconds(tick.inputs.time)
                if (message.log_time, message.publish_time) != (stamp, stamp):
                    raise ValueError("its head was changed")
                self.ticks.append(tick)
                both = self._shown.get(KEPT), self._shown.get(REMOVED)
                self.clouds.append(
                    None if both[0] is None or both[1] is None else (both[0], both[1])
                )
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
        """The summary behind the data: no tick depends on it, but damage is reported."""
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
        if not self.ticks:
            return ", before the first tick"
        lasts = self.ticks[-1].inputs.time - self.ticks[0].inputs.time
        return f", after {len(self.ticks)} ticks up to {lasts:.3f} s"

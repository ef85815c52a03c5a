"""An MCAP file whose messages survive `kill -9`: no chunks, and a flush after every message."""

import json
import warnings
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, BinaryIO, cast

from mcap.writer import CompressionType, IndexType, Writer

from proxcgal.core.closing import Closing
from proxcgal.core.errors import ConfigError

PROFILE = "proxcgal"
SETTINGS = "proxcgal"  #: name of the metadata record


class McapFile(Closing):
    """One log. A full disk stops the log, with a warning, but never the run."""

    def __init__(self, path: str | Path) -> None:
        """Fails early if the path is not writable; an older file of that name stays as it is.

        Args:
            path: of the file.

        Raises:
            ConfigError: the folder cannot be made or the file not be written.
        """
        self.path = Path(path)
        self.failure: str | None = None  #: why it stopped early
        self.started = False
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._is_new = not self.path.exists()
            self._stream = _Checked(self.path.open("ab"))
        except OSError as error:
            raise self.unwritable(error) from None
        self._channels: dict[str, int] = {}
        self._count = 0

    @property
    def crc(self) -> int:
        """CRC-32 of all bytes of the file so far."""
        return self._stream.crc

    def unwritable(self, error: OSError) -> ConfigError:
        """What to raise where the file cannot be begun."""
        return ConfigError(f"recording {self.path}: cannot be written: {error.strerror or error}")

    def begin(
        self, library: str, schemas: Mapping[str, Mapping[str, Any]], settings: Mapping[str, str]
    ) -> None:
        """Replaces what the file holds by the head of a new log. Raises: OSError.

        Args:
            library: that writes it.
            schemas: JSON schema of each topic.
            settings: metadata, before any message.
        """
        self.started = True
        self._stream.close()
        self._stream = _Checked(self.path.open("wb"))
        self.writer = Writer(
            cast("IO[bytes]", self._stream), use_chunking=False, compression=CompressionType.NONE,
            index_types=IndexType.ALL, enable_data_crcs=True,
        )  # fmt: skip
        self.writer.start(PROFILE, library)
        for topic, schema in schemas.items():
            number = self.writer.register_schema(
                str(schema["title"]), "jsonschema", json.dumps(schema).encode()
            )
            self._channels[topic] = self.writer.register_channel(topic, "json", number)
        self.writer.add_metadata(SETTINGS, dict(settings))

    def message(self, topic: str, stamp: int, data: bytes) -> None:
        """Appends a message at a time [ns]; `flush` makes it durable. Raises: OSError."""
        self.writer.add_message(self._channels[topic], stamp, data, stamp, self._count)
        self._count += 1

    def flush(self) -> None:
        """Hands all messages to the operating system. Raises: OSError."""
        self._stream.flush()

    @contextmanager
    def guarded(self) -> Iterator[None]:
        """An OSError within it stops the log: noted in `failure`, with a warning."""
        try:
            yield
        except OSError as error:
            if self.failure is None:
                self.failure = f"recording {self.path} stopped: {error.strerror}"
                warnings.warn(self.failure, RuntimeWarning, stacklevel=4)

    def close(self) -> None:
        """Writes the index and closes the file; a new one that never began is removed."""
        with self.guarded():
            if self.started and self.failure is None:
                self.writer.finish()  # type: ignore[no-untyped-call]
            self._stream.close()
        if self._is_new and not self.started:
            self.path.unlink(missing_ok=True)


class _Checked:
    """A file that knows the CRC-32 of all that was written to it."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.crc = 0
        self.tell, self.flush, self.close = file.tell, file.flush, file.close

    def write(self, data: bytes) -> int:
        self.crc = zlib.crc32(data, self.crc)
        return self._file.write(data)

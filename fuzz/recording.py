"""Fuzz target: recordings, raw or with their checksums put right.

A file that begins as MCAP is read as it is. Other bytes become the content of a tick in a sound
recording, with the right checksums, where a flipped bit would otherwise be all that is ever found.
"""

from __future__ import annotations

import functools
import zlib

from bounds import promises
from mcap.writer import MCAP0_MAGIC
from places import folder

from proxcgal.recording import codec
from proxcgal.recording.reader import read_recording
from proxcgal.recording.writer import Recorder, Settings
from proxcgal.scenario.loading import load_scenario


@functools.cache
def _head() -> bytes:
    """A recording up to its first tick."""
    path = folder() / "head.mcap"
    scenario = load_scenario("front_plane")
    with Recorder(path) as recorder:
        recorder.start(Settings(scenario=scenario, controller="wb", seed=0, meshes={}, versions={}))
        return path.read_bytes()


def _with_tick(content: bytes) -> bytes:
    """A recording, cut off behind a tick of this content."""
    crc = zlib.crc32(_head())
    body = b'{"before":%d,"time":0.0' % crc + content
    data = body + b',"crc":%d}' % zlib.crc32(body)
    stamp = (0).to_bytes(8, "little")
    channel, sequence = (1).to_bytes(2, "little"), (1).to_bytes(4, "little")
    message = channel + sequence + stamp + stamp + data
    return _head() + b"\x05" + len(message).to_bytes(8, "little") + message


def once(data: bytes) -> None:
    """Reads a recording from these bytes; raises where a promise is broken."""
    path = folder() / "run.mcap"
    path.write_bytes(data if data.startswith(MCAP0_MAGIC[:4]) else _with_tick(data))
    with promises():
        for tick in read_recording(path).ticks:
            codec.encode(tick, 0)

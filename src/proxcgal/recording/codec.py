"""Ticks as bytes and back, every input and output at full precision.

A tick is a JSON object, so that Foxglove plots it; its scans are packed, because 1920 ranges as
text would cost more than the tick. Python writes floats so that they read back the same; what
JSON has no number for is written as "nan", "inf", "-inf".
"""

import base64
import json
import math
import struct
import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from proxcgal import _core
from proxcgal.sim.range_sensor import ZONES
from proxcgal.sim.tick import Found, TaskResult, Tick, TickInput, TickResult, TickTruth

_SCAN = struct.Struct("<iIdB")  # sensor, counter, stamp, how the ranges are written
_METRES, _MILLIMETRES = 0, 1


def encode(tick: Tick, before: int) -> bytes:
    """A tick as JSON that carries its own checksum and that of the file before it.

    Args:
        tick: what to write.
        before: CRC-32 of all bytes of the file so far.
    """
    inputs, result, truth = tick.inputs, tick.result, tick.truth
    content = {
        "before": before,
        "time": inputs.time,
        "q": inputs.q.tolist(),
        "goal": inputs.goal.ravel().tolist(),
        "known": inputs.known,
        "late": inputs.late,
        "q_stamp": inputs.q_stamp,
        "scans": base64.b64encode(pack_scans(inputs.scans)).decode(),
        "qd": result.qd.tolist(),
        "mode": result.mode,
        "seen_m": result.seen,
        "link": result.link,
        "surface_W": result.surface_W,
        "obstacle_W": result.obstacle_W,
        "sensor": result.sensor,
        "zone": result.zone,
        "age": result.age,
        "remembered": result.remembered,
        "velocity_W": result.velocity_W,
        "control_W": result.control_W,
        "control_link": result.control_link,
        "cloud_points": result.cloud_points,
        "tasks": [
            {"name": t.name, "rate": t.rate, "activation": t.activation, "residual": t.residual}
            for t in result.tasks
        ],
        "findings": [[f.reason, f.sensor, f.zone, f.link, f.age, f.count] for f in result.findings],
        "tick_us": result.tick_us,
        "true_m": truth.distance,
        "true_link": truth.link,
        "self_m": truth.own,
        "leaked": truth.leaked,
    }
    try:
        text = json.dumps(content, allow_nan=False, separators=(",", ":"))
    except ValueError:
        text = json.dumps(_spelled(content), separators=(",", ":"))
    body = text[:-1].encode()
    return body + b',"crc":%d}' % zlib.crc32(body)


def decode(data: bytes) -> tuple[Tick, int]:
    """A tick, and the checksum it holds of the file before it.

    Raises:
        ValueError: the bytes are not those that were written.
    """
    body, mark, crc = data.rpartition(b',"crc":')
    if not mark or crc != b"%d}" % zlib.crc32(body):
        raise ValueError("its checksum does not fit")
    content = json.loads(data)
    inputs = TickInput(
        time=float(content["time"]),
        q=_array(content["q"]),
        goal=_array(content["goal"]).reshape(4, 4),
        scans=unpack_scans(base64.b64decode(content["scans"])),
        known=content["known"],
        late=content["late"],
        q_stamp=None if (stamp := content.get("q_stamp")) is None else float(stamp),
    )
    result = TickResult(
        qd=_array(content["qd"]),
        mode=content["mode"],
        seen=float(content["seen_m"]),
        link=content["link"],
        surface_W=_floats(content["surface_W"]),
        obstacle_W=_floats(content["obstacle_W"]),
        sensor=content["sensor"],
        zone=content["zone"],
        # Older recordings have none of the next three.
        age=float(content.get("age", 0.0)),
        remembered=content.get("remembered", False),
        velocity_W=_floats(content.get("velocity_W")) or (0.0, 0.0, 0.0),
        control_W=_floats(content["control_W"]),
        control_link=content["control_link"],
        cloud_points=content["cloud_points"],
        tasks=tuple(
            TaskResult(
                t["name"],
                _floats(t["rate"]) or (),
                _floats(t["activation"]) or (),
                _floats(t["residual"]) or (),
            )
            for t in content["tasks"]
        ),
        findings=tuple(
            Found(reason, sensor, zone, link, float(age), count)
            for reason, sensor, zone, link, age, count in content["findings"]
        ),
        tick_us=float(content["tick_us"]),
    )
    truth = TickTruth(
        float(content["true_m"]), content["true_link"], float(content["self_m"]), content["leaked"]
    )
    return Tick(inputs, result, truth), content["before"]


def pack_scans(scans: Sequence[_core.Scan]) -> bytes:
    """Scans one after another: header, 64 status codes, 64 ranges.

    Ranges in whole millimetres, as the sensors send them, take two bytes each, others eight.
    """
    if not scans:
        return b""
    ranges = np.array([scan.ranges for scan in scans])
    with np.errstate(invalid="ignore"):
        steps = np.rint(ranges * 1000.0).astype("<u2")
    exact = (steps / 1000.0).view(np.int64) == ranges.view(np.int64)
    parts = []
    for row, (scan, whole) in enumerate(zip(scans, exact.all(axis=1).tolist(), strict=True)):
        form = _MILLIMETRES if whole else _METRES
        parts += [
            _SCAN.pack(scan.sensor, scan.counter, scan.stamp, form),
            scan.status.tobytes(),
            (steps[row] if whole else ranges[row].astype("<f8")).tobytes(),
        ]
    return b"".join(parts)


def unpack_scans(data: bytes) -> tuple[_core.Scan, ...]:
    """What `pack_scans` packed. Raises: ValueError where the bytes end in the middle of a scan."""
    scans, at = [], 0
    while at < len(data):
        try:
            sensor, counter, stamp, form = _SCAN.unpack_from(data, at)
        except struct.error as error:
            raise ValueError(str(error)) from None
        at += _SCAN.size
        status = np.frombuffer(data, np.uint8, ZONES, at).copy()
        at += ZONES
        if form == _MILLIMETRES:
            ranges = np.frombuffer(data, "<u2", ZONES, at) / 1000.0
            at += 2 * ZONES
        else:
            ranges = np.frombuffer(data, "<f8", ZONES, at).copy()
            at += 8 * ZONES
        scans.append(_core.Scan(sensor, counter, stamp, ranges, status))
    return tuple(scans)


def _spelled(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, dict):
        return {key: _spelled(item) for key, item in value.items()}
    return [_spelled(item) for item in value] if isinstance(value, list | tuple) else value


def _floats(values: Sequence[float | str] | None) -> tuple[float, ...] | None:
    return None if values is None else tuple(float(value) for value in values)


def _array(values: Sequence[float | str]) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.array([float(value) for value in values])

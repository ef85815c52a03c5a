"""Between the controller's values and ROS 2 messages; no node, no clock."""

from __future__ import annotations

import array
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, PoseStamped, Quaternion
from numpy.typing import NDArray
from proxcgal_msgs.msg import Proximity, SensorArray, SensorScan
from sensor_msgs.msg import JointState, PointCloud2, PointField
from std_msgs.msg import Float64MultiArray, Header, MultiArrayDimension

from proxcgal import _core
from proxcgal.sim.tick import TickResult
from proxcgal_ros.restarts import Restarts

Array = NDArray[np.float64]
SECOND = 1_000_000_000  # [ns]

_CLOUD = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("sensor", "<u2"), ("zone", "<u2")])
_FIELDS = [
    PointField(name=name, offset=offset, datatype=kind, count=1)
    for name, offset, kind in (
        ("x", 0, PointField.FLOAT32),
        ("y", 4, PointField.FLOAT32),
        ("z", 8, PointField.FLOAT32),
        ("sensor", 12, PointField.UINT16),
        ("zone", 14, PointField.UINT16),
    )
]


def time_message(nanoseconds: int) -> Time:
    """A stamp."""
    return Time(sec=nanoseconds // SECOND, nanosec=nanoseconds % SECOND)


def nanoseconds(stamp: Time) -> int:
    """A stamp's; 0 where the sender left it out."""
    return int(stamp.sec) * SECOND + int(stamp.nanosec)


def header(stamp_ns: int, frame: str) -> Header:
    """Stamp and frame."""
    return Header(stamp=time_message(stamp_ns), frame_id=frame)


def cloud_message(points_W: Array, origins: NDArray[np.int32], head: Header) -> PointCloud2:
    """The filtered cloud: x, y, z in the base frame [m], and which zone of which sensor saw it."""
    rows = np.empty(len(points_W), _CLOUD)
    for axis, name in enumerate("xyz"):
        rows[name] = points_W[:, axis]
    rows["sensor"], rows["zone"] = origins[:, 0], origins[:, 1]
    return PointCloud2(
        header=head, height=1, width=len(rows), fields=_FIELDS, is_bigendian=False,
        point_step=_CLOUD.itemsize, row_step=rows.nbytes, is_dense=True,
        data=array.array("B", rows.tobytes()),
    )  # fmt: skip


def cloud_rows(message: PointCloud2) -> NDArray[Any]:
    """(n,) rows x, y, z, sensor, zone of such a message."""
    return np.frombuffer(bytes(message.data), _CLOUD)


def command_message(qd: Array) -> Float64MultiArray:
    """Joint velocities [rad/s] or [m/s], in the order of the robot's joints."""
    message = Float64MultiArray(data=qd.tolist())
    message.layout.dim = [MultiArrayDimension(label="joints", size=len(qd), stride=len(qd))]
    return message


def joint_message(names: Sequence[str], q: Array, qd: Array, head: Header) -> JointState:
    """Where the arm stands, and how fast it moves."""
    return JointState(header=head, name=list(names), position=q.tolist(), velocity=qd.tolist())


def joint_positions(message: JointState, names: Sequence[str]) -> Array | None:
    """(n_q,) in the order of `names`, whatever else is told; None where one is missing."""
    if list(message.name) == list(names) and len(message.position) == len(names):
        return np.array(message.position, np.float64)
    place = dict(zip(message.name, message.position, strict=False))
    if not all(name in place for name in names):
        return None
    return np.array([place[name] for name in names], np.float64)


def joint_velocities(message: JointState, names: Sequence[str], fastest: Array) -> Array:
    """(n_q,) in the order of `names`, at most `fastest`; 0 where none is told, or no number."""
    told = dict(zip(message.name, message.velocity, strict=False))
    v = np.array([told.get(name, 0.0) for name in names], np.float64)
    return np.where(np.isfinite(v), np.clip(v, -fastest, fastest), 0.0)


def scan_messages(
    scans: Sequence[_core.Scan], arrays: dict[str, list[int]], stamps_ns: Sequence[int]
) -> dict[str, list[SensorScan]]:
    """What each array has to tell.

    Args:
        scans: of any sensors.
        arrays: rows of the skin of each.
        stamps_ns: when each scan was measured.
    """
    place = {row: (name, at) for name, rows in arrays.items() for at, row in enumerate(rows)}
    told: dict[str, list[SensorScan]] = {}
    for scan, stamp in zip(scans, stamps_ns, strict=True):
        name, at = place[scan.sensor]
        told.setdefault(name, []).append(
            SensorScan(
                stamp=time_message(stamp), sensor=at, counter=scan.counter, ranges=scan.ranges,
                status=scan.status,
            )
        )  # fmt: skip
    return told


def scans_of(
    message: SensorArray, rows: Sequence[int], carried: Callable[[int], float], now: float,
    restarts: Restarts,
) -> list[_core.Scan]:  # fmt: skip
    """The scans of an array's message; a sensor it does not have becomes one unknown to the skin.

    Args:
        message: of its scans at most two for each sensor are looked at.
        rows: of the skin, in the array's order.
        carried: from a stamp [ns] to the controller's clock [s].
        now: [s] of its receipt, on that clock.
        restarts: of the sensors.
    """
    scans = []
    for scan in message.scans[: 2 * len(rows)]:
        row = rows[scan.sensor] if scan.sensor < len(rows) else -1
        stamp = carried(nanoseconds(scan.stamp))
        counter = restarts.counter(row, scan.counter, stamp, now)
        ranges = np.asarray(scan.ranges, np.float64)
        scans.append(_core.Scan(row, counter, stamp, ranges, np.asarray(scan.status, np.uint8)))
    return scans


def proximity_message(result: TickResult, head: Header) -> Proximity:
    """The closest pair and what is done about it."""
    message = Proximity(
        header=head, distance=float(result.seen), link=result.link,
        activation=float(result.activation()), mode=result.mode,
        findings=sorted({found.reason for found in result.findings}),
    )  # fmt: skip
    if result.surface_W is not None and result.obstacle_W is not None:
        message.surface = point(result.surface_W)
        message.obstacle = point(result.obstacle_W)
    return message


def point(values: Sequence[float]) -> Point:
    """A point [m]."""
    return Point(x=float(values[0]), y=float(values[1]), z=float(values[2]))


def pose_message(T_WT: Array, head: Header) -> PoseStamped:
    """A pose of the tool."""
    message = PoseStamped(header=head)
    message.pose.position = point(T_WT[:3, 3])
    x, y, z, w = quaternion(T_WT[:3, :3])
    message.pose.orientation = Quaternion(x=x, y=y, z=z, w=w)
    return message


def pose_of(message: PoseStamped) -> Array:
    """(4, 4) T_WT."""
    place, turn = message.pose.position, message.pose.orientation
    T_WT = np.eye(4)
    T_WT[:3, :3] = rotation((turn.x, turn.y, turn.z, turn.w))
    T_WT[:3, 3] = place.x, place.y, place.z
    return T_WT


def quaternion(R: Array) -> tuple[float, float, float, float]:
    """(x, y, z, w) of a rotation matrix: the eigenvector of Bar-Itzhack's symmetric matrix."""
    (a, b, c), (d, e, f), (g, h, i) = R
    K = np.array(
        [
            [a - e - i, b + d, c + g, h - f],
            [b + d, e - a - i, f + h, c - g],
            [c + g, f + h, i - a - e, d - b],
            [h - f, c - g, d - b, a + e + i],
        ]
    )
    x, y, z, w = (float(value) for value in np.linalg.eigh(K / 3.0)[1][:, -1])
    return (x, y, z, w) if w >= 0.0 else (-x, -y, -z, -w)


def rotation(xyzw: Sequence[float]) -> Array:
    """(3, 3) of a quaternion of any length but 0."""
    x, y, z, w = np.asarray(xyzw, np.float64) / np.linalg.norm(xyzw)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )

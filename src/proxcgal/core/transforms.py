"""Rotations, quaternions and poses: made, turned into one another, inverted, applied.

Rotations are (3, 3) matrices R_WO, poses (4, 4) matrices T_WO that map frame O to frame W.
"""

import math
from collections.abc import Sequence

import numpy as np

from proxcgal.core.typing import Array


def rotation_from_rpy(rpy: Sequence[float] | Array) -> Array:
    """(3, 3) of roll, pitch, yaw [rad]: R = Rz(yaw) Ry(pitch) Rx(roll)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rotation_from_vector(vector: Array) -> Array:
    """(3, 3) of a rotation vector (3,) [rad]."""
    x, y, z = (float(v) for v in vector)
    angle = math.sqrt(x * x + y * y + z * z)
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = x / angle, y / angle, z / angle
    s, c = math.sin(angle), math.cos(angle)
    v = 1.0 - c
    return np.array(
        (
            (c + x * x * v, x * y * v - z * s, x * z * v + y * s),
            (y * x * v + z * s, c + y * y * v, y * z * v - x * s),
            (z * x * v - y * s, z * y * v + x * s, c + z * z * v),
        )
    )


def perpendicular(direction: Array) -> Array:
    """(3,) unit vector at a right angle to a unit vector."""
    across: Array = np.cross(np.eye(3)[np.argmin(np.abs(direction))], direction)
    across /= np.linalg.norm(across)
    return across


def axes_along(direction: Array, otherwise: Sequence[float]) -> Array:
    """(3, 3) rows of a right-handed frame, the first along a direction (3,) of any length.

    Args:
        direction: of the first axis.
        otherwise: unit vector taken where the direction has no length.
    """
    length = np.linalg.norm(direction)
    first = direction / length if length > 0.0 else np.array(otherwise)
    second = perpendicular(first)
    return np.stack([first, second, np.cross(first, second)])


def least_rotation(a: Array, b: Array) -> Array:
    """(3, 3) the least rotation from one unit vector to another."""
    v, c = np.cross(a, b), float(a @ b)
    if c < -1.0 + 1e-9:  # half a turn, about any axis across
        axis = perpendicular(a)
        half: Array = 2.0 * np.outer(axis, axis) - np.eye(3)
        return half
    K = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    turn: Array = np.eye(3) + K + K @ K / (1.0 + c)
    return turn


def least_rotations_of_z(directions: Array) -> Array:
    """(..., 3, 3) the least rotations that bring the z axis along directions (..., 3)."""
    z = directions / np.maximum(np.linalg.norm(directions, axis=-1, keepdims=True), 1e-12)
    x, y, c = z[..., 0], z[..., 1], z[..., 2]
    level2 = x * x + y * y
    down = (c < 0.0) & (level2 < 1e-30)  # no turn is the least one
    # 1 / (1 + c), which cancels where the direction leads down.
    k = np.where(c < 0.0, (1.0 - c) / np.maximum(level2, 1e-30), 1.0 / (1.0 + np.maximum(c, 0.0)))
    R = np.empty((*z.shape[:-1], 3, 3))
    R[..., 0, 0], R[..., 0, 1], R[..., 0, 2] = 1.0 - k * x * x, -k * x * y, x
    R[..., 1, 0], R[..., 1, 1], R[..., 1, 2] = -k * x * y, 1.0 - k * y * y, y
    R[..., 2, 0], R[..., 2, 1], R[..., 2, 2] = -x, -y, c
    R[down] = np.diag((1.0, -1.0, -1.0))
    return R


def sine_axis(R: Array) -> Array:
    """(3,) axis times sine of the angle of a rotation: the rotation vector of small turns."""
    return 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])


def sine_axis_between(here: Array, there: Array) -> Array:
    """(3,) the same of the rotation that brings one orientation (3, 3) to another, in world."""
    axis = np.zeros(3)
    for column in range(3):
        a, b = here[:, column], there[:, column]
        axis[0] += a[1] * b[2] - a[2] * b[1]
        axis[1] += a[2] * b[0] - a[0] * b[2]
        axis[2] += a[0] * b[1] - a[1] * b[0]
    return 0.5 * axis


def quaternion(R: Array) -> Array:
    """(4,) x, y, z, w of a rotation, of either sign.

    Source: Shepperd's method, which divides by the largest of the four components.
    """
    trace = float(np.trace(R))
    k = int(np.argmax([R[0, 0], R[1, 1], R[2, 2], trace]))
    q = np.empty(4)
    if k == 3:
        q[:] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], 1.0 + trace
    else:
        i, j = (k + 1) % 3, (k + 2) % 3
        q[k] = 1.0 - trace + 2.0 * R[k, k]
        q[i], q[j], q[3] = R[i, k] + R[k, i], R[j, k] + R[k, j], R[j, i] - R[i, j]
    return np.asarray(q / np.linalg.norm(q))


def nearest_quaternion(R: Array) -> Array:
    """(4,) x, y, z, w of the rotation nearest to a matrix, w not negative.

    Source: I. Bar-Itzhack, New method for extracting the quaternion from a rotation matrix, 2000.
    """
    K = np.array(
        [
            [R[0, 0] - R[1, 1] - R[2, 2], 0, 0, 0],
            [R[0, 1] + R[1, 0], R[1, 1] - R[0, 0] - R[2, 2], 0, 0],
            [R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], R[2, 2] - R[0, 0] - R[1, 1], 0],
            [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], np.trace(R)],
        ]
    )
    vector = np.linalg.eigh(K / 3.0, "L")[1][:, -1]
    return vector if vector[3] >= 0 else -vector


def pose(
    position: Sequence[float] | Array, rpy: Sequence[float] | Array = (0.0, 0.0, 0.0)
) -> Array:
    """(4, 4) T_WO of a position [m] and roll, pitch, yaw [rad]."""
    T_WO = np.eye(4)
    T_WO[:3, :3] = rotation_from_rpy(rpy)
    T_WO[:3, 3] = position
    return T_WO


def pose_errors(T_WT: Array, goal: Array) -> tuple[float, float]:
    """Distance [m] and angle [rad] between two poses; accurate near 0 too."""
    chord = np.linalg.norm(goal[:3, :3] - T_WT[:3, :3]) / np.sqrt(8.0)
    angle = 2.0 * np.arcsin(min(float(chord), 1.0))
    return float(np.linalg.norm(goal[:3, 3] - T_WT[:3, 3])), float(angle)


def inverse(T: Array) -> Array:
    """Inverse of (..., 4, 4) poses."""
    out = np.zeros_like(T)
    out[..., :3, :3] = np.swapaxes(T[..., :3, :3], -1, -2)
    out[..., :3, 3] = -np.einsum("...ji,...j->...i", T[..., :3, :3], T[..., :3, 3])
    out[..., 3, 3] = 1.0
    return out


def nearest_rotation(R: Array) -> Array:
    """(3, 3) the rotation nearest to a matrix, by the sum of squares (Kabsch 1976)."""
    U, _, V = np.linalg.svd(R)
    near: Array = U @ np.diag([1.0, 1.0, np.linalg.det(U @ V)]) @ V
    return near


def placed(T_WO: Array, points_O: Array) -> Array:
    """(n, 3) points of frame O in W."""
    points_W: Array = points_O @ T_WO[:3, :3].T + T_WO[:3, 3]
    return points_W

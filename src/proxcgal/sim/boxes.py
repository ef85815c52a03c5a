"""Boxes of a scene: where they stand, their surface as triangles and as points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Corner k of the unit cube has the bits of k as coordinates; two triangles a face, outward.
_CORNERS = np.array([[k & 1, k >> 1 & 1, k >> 2 & 1] for k in range(8)]) - 0.5
_TRIANGLES = np.array(
    [[0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5], [0, 1, 5], [0, 5, 4],
     [2, 6, 7], [2, 7, 3], [0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6]],
    np.int32,
)  # fmt: skip


def rotation(rpy: Sequence[float]) -> Array:
    """(3, 3) of roll, pitch, yaw [rad]: R = Rz(yaw) Ry(pitch) Rx(roll)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def pose(position: Sequence[float], rpy: Sequence[float]) -> Array:
    """(4, 4) T_WO."""
    T_WO = np.eye(4)
    T_WO[:3, :3] = rotation(rpy)
    T_WO[:3, 3] = position
    return T_WO


def surface(size: Sequence[float], T_WO: Array) -> tuple[Array, NDArray[np.int32]]:
    """Vertices_W (8, 3) and triangles (12, 3) of a box with these edge lengths [m]."""
    return _CORNERS * np.asarray(size) @ T_WO[:3, :3].T + T_WO[:3, 3], _TRIANGLES


def nearest_point(size: Sequence[float], T_WO: Array, point_W: Array) -> Array:
    """(3,) the point of a solid box nearest to a point, in world."""
    half = 0.5 * np.asarray(size)
    inside: Array = np.clip(T_WO[:3, :3].T @ (point_W - T_WO[:3, 3]), -half, half)
    return T_WO[:3, :3] @ inside + T_WO[:3, 3]


def points(size: Sequence[float], T_WO: Array, spacing: float) -> Array:
    """(n, 3) points of the surface in world, at most `spacing` apart along its edges [m]."""
    ticks = [_ticks(edge, spacing) for edge in size]
    faces = []
    for axis, edge in enumerate(size):
        u, v = (other for other in range(3) if other != axis)
        grid_u, grid_v = np.meshgrid(ticks[u], ticks[v], indexing="ij")
        for side in (-0.5 * edge, 0.5 * edge):
            face = np.full((grid_u.size, 3), side)
            face[:, u], face[:, v] = grid_u.ravel(), grid_v.ravel()
            faces.append(face)
    points_O = np.unique(np.concatenate(faces), axis=0)  # edges belong to two faces
    return points_O @ T_WO[:3, :3].T + T_WO[:3, 3]


def _ticks(edge: float, spacing: float) -> Array:
    return np.linspace(-0.5 * edge, 0.5 * edge, int(np.ceil(edge / spacing - 1e-9)) + 1)

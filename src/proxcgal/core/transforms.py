"""Poses as (4, 4) matrices: made, inverted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from proxcgal.core.typing import Array


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


def pose(position: Sequence[float], rpy: Sequence[float] = (0.0, 0.0, 0.0)) -> Array:
    """(4, 4) T_WO."""
    T_WO = np.eye(4)
    T_WO[:3, :3] = rotation(rpy)
    T_WO[:3, 3] = position
    return T_WO


def inverse(T: Array) -> Array:
    """Inverse of (..., 4, 4) poses."""
    out = np.zeros_like(T)
    out[..., :3, :3] = np.swapaxes(T[..., :3, :3], -1, -2)
    out[..., :3, 3] = -np.einsum("...ji,...j->...i", T[..., :3, :3], T[..., :3, 3])
    out[..., 3, 3] = 1.0
    return out


def placed(T_WO: Array, points_O: Array) -> Array:
    """(n, 3) points of frame O in W."""
    points_W: Array = points_O @ T_WO[:3, :3].T + T_WO[:3, 3]
    return points_W

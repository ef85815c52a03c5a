"""Algorithms 1 and 2 round the libraries' queries, in numpy, all points of a link at once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from peer_libraries import MIN_HIT

from proxcgal.models.robots import Robot
from proxcgal.study.timing.inputs import Inputs

Array = NDArray[np.float64]


class Spheres:
    """A sphere round each link: what tells, before a query, that it need not be asked."""

    def __init__(self, robot: Robot) -> None:
        self._centers_L, self._radii = [], []
        for link in robot.link_names:
            vertices_L = robot.mesh(link)[0]
            center_L = 0.5 * (vertices_L.min(axis=0) + vertices_L.max(axis=0))
            self._centers_L.append(center_L)
            self._radii.append(np.linalg.norm(vertices_L - center_L, axis=1).max())

    def gaps(self, poses_W: Array, points_W: Array) -> Array:
        """(links, n) least distance that each point can have from each link [m]."""
        rotated = np.einsum("lij,lj->li", poses_W[:, :3, :3], np.array(self._centers_L))
        centers_W = rotated + poses_W[:, :3, 3]
        squared = (points_W**2).sum(axis=1) - 2.0 * centers_W @ points_W.T
        squared += (centers_W**2).sum(axis=1)[:, None]
        return np.sqrt(np.maximum(squared, 0.0)) - np.array(self._radii)[:, None]


def remove_body(peer: Any, inputs: Inputs, spheres: Spheres | None = None) -> NDArray[np.bool_]:
    """Algorithm 1: (n,) true where a point is kept; `spheres` spare the rays that cannot matter."""
    keep = np.ones(len(inputs.points_W), bool)
    rays_W = inputs.points_W - inputs.origins_W
    length = np.sqrt(np.einsum("ij,ij->i", rays_W, rays_W))
    directions_W = rays_W / length[:, None]
    starts_W = inputs.origins_W + MIN_HIT * directions_W  # past the emitter's own mounting
    far = length + inputs.tolerance - MIN_HIT
    poses_W = np.asarray(inputs.robot.link_poses(inputs.q))
    near = None
    if spheres is not None:
        near = spheres.gaps(poses_W, inputs.points_W) <= inputs.tolerance
    for link, T_WL in enumerate(poses_W):
        rows = slice(None) if near is None else np.flatnonzero(near[link] & keep)
        starts_L = (starts_W[rows] - T_WL[:3, 3]) @ T_WL[:3, :3]
        if not len(starts_L):
            continue
        hits = peer.first_hits(link, starts_L, directions_W[rows] @ T_WL[:3, :3], far[rows])
        keep[rows] &= ~(np.abs(hits + MIN_HIT - length[rows]) <= inputs.tolerance[rows])
    return keep


def closest(peer: Any, inputs: Inputs, spheres: Spheres | None = None) -> float:
    """Algorithm 2: the least distance [m]; `spheres` give the order, and spare what is too far."""
    if hasattr(peer, "closest"):
        return peer.closest(inputs)
    points_W = inputs.environment_W
    poses_W = np.asarray(inputs.robot.link_poses(inputs.q))
    best = np.inf
    if spheres is None:
        for link, T_WL in enumerate(poses_W):
            points_L = (points_W - T_WL[:3, 3]) @ T_WL[:3, :3]
            best = min(best, peer.nearest(link, points_L, best))
        return best
    gaps = spheres.gaps(poses_W, points_W)
    for link in np.argsort(gaps.min(axis=1)).tolist():
        rows = np.flatnonzero(gaps[link] < best)
        rows = rows[np.argsort(gaps[link, rows])]
        R_WL, origin_W = poses_W[link, :3, :3], poses_W[link, :3, 3]
        batch = 1  # small batches first: they tell which of the others are too far
        while len(rows):
            now, rows = rows[:batch], rows[batch:]
            best = min(best, peer.nearest(link, (points_W[now] - origin_W) @ R_WL, best))
            rows = rows[gaps[link, rows] < best]
            batch *= 8
    return best

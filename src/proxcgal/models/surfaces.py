"""A robot's full-resolution surfaces, and which pairs of them say something about its motion."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from proxcgal import _core
from proxcgal.core.cache import Cache, Stored
from proxcgal.core.transforms import inverse, placed
from proxcgal.core.typing import Array, Bools
from proxcgal.models.robots import Robot, once_per_robot

#: Links nearer than this in every random posture are built that way [m].
ALWAYS_NEAR = 0.05
_POSTURES = 1000
_PROBES = 32


class Surfaces:
    """What never changes about a robot; made once for each."""

    def __init__(self, robot: Robot) -> None:
        """Indexes every link's full mesh."""
        meshes = [robot.full_mesh(name) for name in robot.link_names]
        self.trees = [_core.MeshTree(*mesh) for mesh in meshes]
        self._vertices = [np.asarray(vertices_L, np.float64) for vertices_L, _ in meshes]
        low = np.array([vertices_L.min(axis=0) for vertices_L in self._vertices])
        high = np.array([vertices_L.max(axis=0) for vertices_L in self._vertices])
        self._centers = 0.5 * (low + high)
        #: (links,) [m] of the ball round each link, about the middle of its box.
        self.radii = np.array([
            np.linalg.norm(vertices_L - center, axis=1).max()
            for vertices_L, center in zip(self._vertices, self._centers, strict=True)
        ])  # fmt: skip
        poses = np.array([robot.link_poses(q) for q in random_postures(robot, _POSTURES)])
        moves = np.array([
            [robot.moves(joint, link) for joint in robot.joint_names] for link in robot.link_names
        ])  # fmt: skip
        #: Rows of the links that some joint moves.
        self.moving = [int(link) for link in np.flatnonzero(moves.any(axis=1))]
        digest = hashlib.sha256(poses.tobytes()).hexdigest()
        key = [ALWAYS_NEAR, digest, *(kinds["full"] for kinds in robot.mesh_hashes.values())]
        #: (k, 2) pairs of links that are neither neighbours nor near in every posture.
        self.self_pairs = cached_pairs(
            "self_pairs",
            key,
            lambda: [
                pair
                for pair in combinations(range(len(self.trees)), 2)
                if self._joints_between(moves, *pair) > 1 and not self._always_near(*pair, poses)
            ],
        )

    @staticmethod
    @once_per_robot
    def of(robot: Robot) -> Surfaces:
        """Those of a robot, kept as long as it lives."""
        return Surfaces(robot)

    def motion(self, links: NDArray[np.intp], before: Array, after: Array) -> Array:
        """(k,) no point of these links (k,) moved farther between two poses (k, 4, 4) [m]."""
        return most_moved(self.sweep(links, before), self.sweep(links, after))

    def sweep(self, links: NDArray[np.intp], poses: Array) -> Array:
        """(k, 12) of links (k,) at poses (k, 4, 4), for `most_moved` [m]: centre, turned radius."""
        radii, R = self.radii[links, None, None], poses[:, :3, :3]
        centers = np.einsum("nij,nj->ni", R, self._centers[links]) + poses[:, :3, 3]
        # A difference of rotations has two equal singular values and a zero.
        return np.hstack([centers, (R * radii / np.sqrt(2.0)).reshape(-1, 9)])

    @staticmethod
    def _joints_between(moves: Bools, a: int, b: int) -> int:
        """How many joints move one of two links and not the other; neighbours have one."""
        return int((moves[a] != moves[b]).sum())

    def _always_near(self, a: int, b: int, poses: Array) -> bool:
        """Mostly the first posture says no; where none does, the nearest vertices say yes."""
        probes_B = np.empty((0, 3))
        for pose in poses:
            T_AB = inverse(pose[a]) @ pose[b]
            probes_A = placed(T_AB, probes_B)
            if len(probes_A) and self.trees[a].closest(probes_A)[0].min() < ALWAYS_NEAR:
                continue
            distance, _, near_B = self.trees[a].distance(self.trees[b], T_AB, ALWAYS_NEAR)
            if distance >= ALWAYS_NEAR:
                return False
            order = np.linalg.norm(self._vertices[b] - near_B, axis=1).argsort()
            probes_B = np.concatenate([self._vertices[b][order[:_PROBES]], probes_B])[:2000]
        return True


def random_postures(robot: Robot, count: int) -> Array:
    """(count, n_q) within limits, of at most half a turn either way; the same every time."""
    reach = np.maximum(robot.q_min, -np.pi), np.minimum(robot.q_max, np.pi)
    return np.random.default_rng(0).uniform(*reach, (count, robot.n_q))


def cached_pairs(
    kind: str, key: Sequence[Any], make: Callable[[], Sequence[tuple[int, int]]]
) -> NDArray[np.int64]:
    """(k, 2) pairs of link rows, from the cache where they were made from the same key before."""
    kept = Cache(kind)
    entry = kept.get(key)
    if entry is None:
        entry = Stored({"pairs": np.array(make(), np.int64).reshape(-1, 2)}, {})
        kept.put(key, entry)
    return entry.arrays["pairs"]


def most_moved(before: Array, after: Array) -> Array:
    """(k,) no point of a link moved farther between two rows of `Surfaces.sweep` (k, 12) [m]."""
    step = after - before
    shifted, turned = (
        np.sqrt(np.einsum("ni,ni->n", part, part)) for part in (step[:, :3], step[:, 3:])
    )
    return np.asarray(shifted + turned)

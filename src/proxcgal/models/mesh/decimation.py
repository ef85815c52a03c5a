"""Fewer triangles, the surface kept: quadric edge collapse with a bound on how far points move.

Robot meshes are drawn for pictures: open, in many parts, with walls inside. The collapse of
fast-simplification leaves spikes of 40 mm on them and swallows small parts. Here a rim costs as
much as a crease, a part never shrinks to nothing, and samples of the old surface stay within a
tolerance of the triangles that replace them, samples of the new ones within it of the old surface.

Source: M. Garland and P. Heckbert, Surface simplification using quadric error metrics, 1997. Edges
are taken in rounds of collapses that do not touch one another, so that each round is array work.
"""

import numpy as np

from proxcgal._core import MeshTree
from proxcgal.core.typing import Array, Bools, Ints
from proxcgal.models.mesh.quadrics import cost, minimum, surface_quadrics
from proxcgal.models.mesh.triangles import (
    compact,
    dot,
    double_areas,
    edges_of,
    face_vectors,
    faces_per_vertex,
    gather,
    point_triangle_distance,
    sample,
)

# Of two equally flat edges the shorter goes first: keeps triangles round.
_LENGTH_WEIGHT = 1e-9
# A collapse may not turn a face by more than about 73 degrees.
_MIN_NORMAL_DOT = 0.3
# Nor make it thinner than this (doubled area over its longest edge squared), unless it was.
_MIN_ASPECT = 0.02
# Share of the edges looked at in a round, cheapest first, and of those that may be taken: a small
# share follows the order of cost, a large one takes fewer rounds.
_CANDIDATES = 0.3
_TAKEN = 0.6
_PASSES = 3
# Share of the vertices that a round must take to go on with a tolerance that may be widened.
_WORTHWHILE = 0.01
# Where any tolerance goes, as small a one as will do is looked for from here, by doubling [m].
_FIRST_TOLERANCE = 0.002
# Past this one, small parts and the topology are given up first [m].
_STRICT_TOLERANCE = 0.008
# Spacing of the samples that hold the tolerance [m], and how many there may be on the old surface.
_SPACING = 0.004
_MOST_SAMPLES = 40_000


class _Surface:
    """A surface in the middle of its simplification. Vertex rows stay, faces shrink."""

    def __init__(self, vertices: Array, triangles: Ints, tolerance: float) -> None:
        self.v = vertices.copy()
        self.f = triangles.astype(np.int64)
        self.count = len(np.unique(self.f))
        self.tolerance = tolerance
        self.blocked = np.empty(0, dtype=np.int64)  # edges (as keys) that would move points too far
        self.strict = True  # keep parts, rims and the sense of faces
        self.share = _CANDIDATES
        if np.isfinite(tolerance):
            self.old = MeshTree(vertices, triangles)
            area = double_areas(vertices, triangles).sum() / 2
            spacing = max(_SPACING, float(np.sqrt(area / _MOST_SAMPLES)))
            # Every sample hangs on the face that stands for its surroundings now.
            self.samples, self.home = sample(vertices, triangles, spacing)
        self.Q, self.on_rim = surface_quadrics(vertices, self.f)

    def round(self, count: int) -> tuple[int, int]:
        """One round of independent collapses; returns how many were tried, and done."""
        n = len(self.v)
        edges, faces_on_edge = edges_of(self.f, n)
        place, key = self._placements(edges, faces_on_edge)
        key[np.isin(edges[:, 0] * n + edges[:, 1], self.blocked)] = np.inf
        take = min(max(int(self.share * len(edges)), 200), len(edges))
        rows = np.argpartition(key, take - 1)[:take]
        rows = rows[np.isfinite(key[rows])]
        start, face_of = faces_per_vertex(self.f, n)
        if self.strict:
            rows = rows[self._keeps_topology(edges[rows], faces_on_edge[rows], start, face_of)]
            rows = rows[self._keeps_faces(edges[rows], place[rows], start, face_of)]
        rows = rows[np.argsort(key[rows], kind="stable")][: max(50, int(_TAKEN * len(rows)))]
        rows = rows[self._independent(edges[rows])][: self.count - count]
        tried = len(rows)
        if np.isfinite(self.tolerance):
            near, moved, home = self._keeps_points(edges[rows], place[rows], start, face_of)
            self.blocked = np.append(self.blocked, edges[rows[~near]] @ np.array([n, 1]))
            self.home[moved] = home
            rows = rows[near]
        self._collapse(edges[rows], place[rows])
        return tried, len(rows)

    def loosen(self, size: float) -> None:
        """Allow twice the tolerance; when that has not helped, parts may go, small ones first."""
        self.blocked = np.empty(0, dtype=np.int64)
        self.tolerance *= 2
        if self.strict and self.tolerance > _STRICT_TOLERANCE:
            self.tolerance, self.strict = _FIRST_TOLERANCE, False
        elif self.tolerance > size:
            self.tolerance = np.inf

    def _placements(self, edges: Ints, faces_on_edge: Ints) -> tuple[Array, Array]:
        """Where each edge would go, and what it costs [m^4]."""
        a, b = edges.T
        q = self.Q[a] + self.Q[b]
        middle = (self.v[a] + self.v[b]) / 2
        length = np.linalg.norm(self.v[a] - self.v[b], axis=1)
        place = minimum(q, middle)
        # Towards a rim, not away from it.
        one = self.on_rim[a] ^ self.on_rim[b]
        place[one] = np.where(self.on_rim[a][:, None], self.v[a], self.v[b])[one]
        far = np.linalg.norm(place - middle, axis=1) > 1.5 * length
        place[far] = middle[far]
        key = np.maximum(cost(q, place), 0) + _LENGTH_WEIGHT * length**2
        # An edge through the inside that joins two rims would pinch the surface.
        if self.strict:
            key[self.on_rim[a] & self.on_rim[b] & (faces_on_edge > 1)] = np.inf
        return place, key

    def _keeps_topology(
        self, edges: Ints, faces_on_edge: Ints, start: Ints, face_of: Ints
    ) -> Bools:
        """Link condition, and no part may lose its last faces."""
        n = len(self.v)
        seen = []
        for end in range(2):
            edge, face = gather(start, face_of, edges[:, end])
            corner = self.f[face]
            seen.append(np.unique(np.repeat(edge, 3) * n + corner.ravel()))
        both = np.intersect1d(seen[0], seen[1], assume_unique=True) // n
        shared = np.bincount(both, minlength=len(edges)) - 2  # less the edge's own ends
        around = start[edges + 1] - start[edges]
        left = around.sum(1) - 2 * faces_on_edge
        return np.asarray((shared == faces_on_edge) & (left >= 2))

    def _keeps_faces(self, edges: Ints, place: Array, start: Ints, face_of: Ints) -> Bools:
        """No face turns over or becomes a sliver."""
        good = np.ones(len(edges), dtype=bool)
        for end in range(2):
            edge, corners, moved, _ = self._ring(edges, end, start, face_of)
            before = self.v[corners]
            after = np.where(moved[..., None], place[edge][:, None, :], before)
            n0, n1 = face_vectors(before), face_vectors(after)
            l0, l1 = np.sqrt(dot(n0, n0)), np.sqrt(dot(n1, n1))
            aspect0, aspect1 = l0 / _longest(before) ** 2, l1 / _longest(after) ** 2
            bad = dot(n0, n1) < _MIN_NORMAL_DOT * l0 * l1
            bad |= (aspect1 < _MIN_ASPECT) & (aspect1 < 0.5 * aspect0)
            good[edge[bad]] = False
        return good

    def _keeps_points(
        self, edges: Ints, place: Array, start: Ints, face_of: Ints
    ) -> tuple[Bools, Ints, Ints]:
        """Which collapses keep old and new surface within the tolerance of each other.

        Also the samples that change their face if those are done, and the face of each.
        """
        rings = [self._ring(edges, end, start, face_of) for end in range(2)]
        edge, corners, moved, faces = (np.concatenate([r[k] for r in rings]) for k in range(4))
        order = np.argsort(edge, kind="stable")
        edge, corners, moved, faces = edge[order], corners[order], moved[order], faces[order]
        after = np.where(moved[..., None], place[edge][:, None, :], self.v[corners])
        first = np.searchsorted(edge, np.arange(len(edges) + 1))

        by_home = np.argsort(self.home, kind="stable")
        home_start = np.searchsorted(self.home[by_home], np.arange(len(self.f) + 1))
        # Faces at either end, those between both ends once.
        at = np.concatenate([gather(start, face_of, edges[:, end]) for end in range(2)], axis=1)
        key = np.unique(at[0] * len(self.f) + at[1])
        of, held = gather(home_start, by_home, key % len(self.f))
        of = (key // len(self.f))[of]
        # Most stay near the face that they hang on; only the others look for a nearer one.
        row = np.full(len(self.f), -1)
        row[faces] = np.arange(len(faces))
        on = row[self.home[held]]
        gap = np.full(len(held), np.inf)
        gap[on >= 0] = point_triangle_distance(self.samples[held[on >= 0]], after[on[on >= 0]])
        of, held = of[gap > self.tolerance], held[gap > self.tolerance]
        pair, face = gather(first, np.arange(len(after)), of)
        distance = point_triangle_distance(self.samples[held[pair]], after[face])
        best = np.lexsort((distance, pair))
        best = best[np.r_[True, np.diff(pair[best]) > 0]] if len(best) else best
        nearest, home = np.full(len(held), np.inf), np.full(len(held), -1)
        nearest[pair[best]], home[pair[best]] = distance[best], faces[face[best]]
        # Where nothing is left of a part, the point it went to stands for it.
        gone = home < 0
        nearest[gone] = np.linalg.norm(self.samples[held[gone]] - place[of[gone]], axis=1)
        good = np.ones(len(edges), dtype=bool)
        good[of[nearest > self.tolerance]] = False

        check = np.nonzero(good[edge])[0]
        points, on = sample(after[check].reshape(-1, 3), np.arange(3 * len(check)).reshape(-1, 3),
                            _SPACING, corners=False)  # fmt: skip
        off = self.old.closest(np.concatenate([points, place]))[0] > self.tolerance
        good[edge[check[on[off[: len(points)]]]]] = False
        good[off[len(points) :]] = False
        done = good[of]
        return good, held[done], home[done]

    def _ring(
        self, edges: Ints, end: int, start: Ints, face_of: Ints
    ) -> tuple[Ints, Ints, Bools, Ints]:
        """Faces at one end that outlive a collapse: edge row, corners, which one moves, face."""
        edge, face = gather(start, face_of, edges[:, end])
        corners = self.f[face]
        here, there = (corners == edges[edge, e][:, None] for e in (end, 1 - end))
        stays = ~there.any(1)
        return edge[stays], corners[stays], here[stays], face[stays]

    def _independent(self, edges: Ints) -> Ints:
        """Rows, cheapest first, of edges whose surroundings no other taken edge touches."""
        n = len(self.v)
        taken: list[Ints] = []
        free = np.arange(len(edges))
        blocked = np.zeros(n, dtype=bool)
        for _ in range(_PASSES):
            if not len(free):
                break
            rank = np.full(n, len(edges))
            for end in range(2):
                np.minimum.at(rank, edges[free, end], free)
            around = rank.copy()
            face_rank = rank[self.f].min(1)
            for corner in range(3):
                np.minimum.at(around, self.f[:, corner], face_rank)
            won = free[(around[edges[free]] == free[:, None]).all(1)]
            taken.append(won)
            moved = np.zeros(n, dtype=bool)
            moved[edges[won].ravel()] = True
            blocked[self.f[moved[self.f].any(1)].ravel()] = True
            free = free[~blocked[edges[free]].any(1)]
        return np.sort(np.concatenate(taken)) if taken else free

    def _collapse(self, edges: Ints, place: Array) -> None:
        n = len(self.v)
        a, b = edges.T
        self.v[a] = place
        self.Q[a] += self.Q[b]
        self.on_rim[a] |= self.on_rim[b]
        into = np.arange(n)
        into[b] = a
        self.f = into[self.f]
        stays = (self.f != np.roll(self.f, 1, axis=1)).all(1)
        self.f = self.f[stays]
        if np.isfinite(self.tolerance):
            self.home = np.where(self.home < 0, -1, (np.cumsum(stays) - 1)[self.home])
        self.count = len(np.unique(self.f))
        # What moved may now be collapsed where it could not be before.
        changed = np.zeros(n, dtype=bool)
        changed[a] = changed[b] = True
        known = changed[self.blocked // n] | changed[self.blocked % n]
        self.blocked = self.blocked[~known]


def decimate(
    vertices: Array, triangles: Ints, count: int, tolerance: float = np.inf
) -> tuple[Array, Ints]:
    """Collapse edges until `count` vertices are left, or until none may go.

    Args:
        vertices: (v, 3) [m], welded: parts are joined where they share a row.
        triangles: (f, 3).
        count: vertices to aim at.
        tolerance: bound on the distance between samples of the old surface and the new one, and
            back [m]. Inf keeps it as small as `count` allows, which is reached in any case, if need
            be without the smallest parts.

    Returns:
        vertices (about `count` or more, 3) and triangles of the new surface.
    """
    bounded = bool(np.isfinite(tolerance))
    surface = _Surface(vertices, triangles, tolerance if bounded else _FIRST_TOLERANCE)
    size = float(np.ptp(vertices, axis=0).max())
    while surface.count > count:
        tried, done = surface.round(count)
        # Where the tolerance is free, there is no need to wring out the last that it allows.
        if tried and (bounded or done >= _WORTHWHILE * surface.count):
            continue
        if surface.share < 1:  # none of the cheap ones will do: look at all
            surface.share = 1.0
            continue
        if np.isfinite(surface.tolerance) and not bounded:
            surface.loosen(size)
        elif not done:
            break
    return compact(surface.v, surface.f)


def _longest(p: Array) -> Array:
    sides = p - np.roll(p, 1, axis=1)
    return np.asarray(np.sqrt(np.maximum((sides**2).sum(2).max(1), 1e-300)))

"""The controller's meshes: as many vertices as asked for, the surface where it was."""

import json
from dataclasses import dataclass

import numpy as np

from proxcgal._core import MeshTree
from proxcgal.core.cache import Cache, Stored, hash_mesh
from proxcgal.core.errors import ConfigError
from proxcgal.core.typing import Array, Ints
from proxcgal.models.mesh.decimation import decimate
from proxcgal.models.mesh.triangles import compact, double_areas, half_edges, is_number, sample

# Bump when the same mesh and settings give another result.
_VERSION = 2
# Fewer enclose nothing that stands for a link; more are no mesh for a control loop, and fill the
# memory before they are made.
MIN_VERTICES, MAX_VERTICES = 8, 1_000_000
# What counts as the number of vertices asked for.
COUNT_TOLERANCE = 0.1
# Deviation is measured at points this far apart [m], but never at more than so many a mesh.
_SPACING = 0.001
_MOST_SAMPLES = 400_000
# Collapses keep within this share of the bound: between samples the surface may be farther off.
_MARGINS = (0.85, 0.7, 0.6, 0.45, 0.25)
# Of edges that are halved, those at least this share of the longest go in the same round.
_LONG_SHARE = 0.7
# What is measured may be a little less than what a denser look would find.
_SURE = 0.97


@dataclass(frozen=True, slots=True, eq=False)
class ControlMesh:
    """The mesh that the controller uses for one link."""

    vertices_L: Array  # (v, 3) [m]
    triangles: Ints  # (f, 3)
    deviation: float  # how far it and the full mesh are apart at most, both ways [m]


def check_resolution(name: str, count: object, max_deviation: object) -> None:
    """Refuse what no control mesh can be made to.

    Args:
        name: of the argument that gives the count, for the message.
        count: vertices asked for; None keeps a mesh as it is.
        max_deviation: [m], may be inf.

    Raises:
        ConfigError: not a whole number within bounds, or a deviation that is not above 0.
    """
    whole = isinstance(count, int | np.integer) and MIN_VERTICES <= count <= MAX_VERTICES
    if not (count is None or whole):
        raise ConfigError(
            f"{name} = {count!r}; a whole number from {MIN_VERTICES} to {MAX_VERTICES}, or None"
        )
    if not (is_number(max_deviation) and max_deviation > 0):
        raise ConfigError(f"max_deviation = {max_deviation!r}; a number above 0 [m]")


def control_mesh(
    vertices: Array, triangles: Ints, count: int | None, max_deviation: float
) -> ControlMesh:
    """A mesh of about `count` vertices, from the cache where it was made before.

    Args:
        vertices: (v, 3) [m], welded, full resolution.
        triangles: (f, 3).
        count: vertices asked for; None keeps the mesh as it is.
        max_deviation: bound on how far the surface may move [m]; where it cannot be kept with so
            few vertices, more are kept. Inf holds to the count alone.

    Returns:
        the mesh and its measured deviation.
    """
    if count is None or abs(len(vertices) - count) <= COUNT_TOLERANCE / 2 * count:
        return ControlMesh(vertices, triangles, 0.0)
    cache = Cache("control")
    key = [_VERSION, hash_mesh(vertices, triangles), count, json.dumps(max_deviation)]
    if (kept := cache.get(key)) is not None and {"v", "f"} <= kept.arrays.keys():
        return ControlMesh(kept.arrays["v"], kept.arrays["f"], float(kept.meta["deviation"]))
    if len(vertices) < count:
        made = ControlMesh(*subdivide(vertices, triangles, count), 0.0)
    else:
        made = _coarser(vertices, triangles, count, max_deviation)
    cache.put(key, Stored({"v": made.vertices_L, "f": made.triangles},
                          {"deviation": made.deviation}))  # fmt: skip
    return made


def _coarser(vertices: Array, triangles: Ints, count: int, bound: float) -> ControlMesh:
    if not np.isfinite(bound):
        v, f = decimate(vertices, triangles, count)
        return ControlMesh(v, f, deviation(vertices, triangles, v, f))
    for margin in _MARGINS:
        v, f = decimate(vertices, triangles, count, margin * bound)
        if (moved := deviation(vertices, triangles, v, f)) <= _SURE * bound:
            return ControlMesh(v, f, moved)
    return ControlMesh(vertices, triangles, 0.0)


def deviation(vertices_a: Array, triangles_a: Ints, vertices_b: Array, triangles_b: Ints) -> float:
    """How far two surfaces are apart at most, from samples of each to the other [m]."""
    return max(
        _one_way(vertices_a, triangles_a, MeshTree(vertices_b, triangles_b)),
        _one_way(vertices_b, triangles_b, MeshTree(vertices_a, triangles_a)),
    )


def _one_way(vertices: Array, triangles: Ints, other: MeshTree) -> float:
    area = double_areas(vertices, triangles).sum() / 2
    points, _ = sample(vertices, triangles, max(_SPACING, float(np.sqrt(area / _MOST_SAMPLES))),
                       corners=False)  # fmt: skip
    points = np.concatenate([compact(vertices, triangles)[0], points])
    return float(other.closest(points)[0].max())


def subdivide(vertices: Array, triangles: Ints, count: int) -> tuple[Array, Ints]:
    """Halve edges until there are `count` vertices; no point of the surface moves.

    An edge goes when it is the longest of each of its faces, and every face on it is cut, so that
    no gap opens.

    Args:
        vertices: (v, 3) [m], welded.
        triangles: (f, 3).
        count: at least v.

    Returns:
        vertices (count, 3) and triangles; the first v vertices are those given.
    """
    v, f = vertices, triangles.astype(np.int64)
    while len(v) < count:
        sides = np.sort(half_edges(f), axis=1) @ np.array([len(v), 1])
        key, rows_of = np.unique(sides, return_inverse=True)
        edge_of = rows_of.reshape(3, -1).T  # (f, 3)
        a, b = key // len(v), key % len(v)
        length = np.linalg.norm(v[a] - v[b], axis=1)
        order = np.argsort(-length, kind="stable")
        rank = np.argsort(order)
        # The face's longest side, and edges that are that for all their faces.
        longest = np.take_along_axis(edge_of, rank[edge_of].argmin(axis=1)[:, None], axis=1)[:, 0]
        wanted = np.bincount(longest, minlength=len(key))
        terminal = (wanted == np.bincount(edge_of.ravel(), minlength=len(key))) & (wanted > 0)
        chosen = order[terminal[order] & (length[order] >= _LONG_SHARE * length[order[0]])]
        chosen = chosen[: count - len(v)]
        middle = np.full(len(key), -1)
        middle[chosen] = len(v) + np.arange(len(chosen))
        v = np.concatenate([v, (v[a[chosen]] + v[b[chosen]]) / 2])
        cut = middle[longest] >= 0
        side = (edge_of[cut] == longest[cut, None]).argmax(axis=1)
        old = f[cut]
        rows = np.arange(len(old))
        corner = [old[rows, (side + k) % 3] for k in range(3)]
        new = middle[longest[cut]]
        f = np.concatenate([
            f[~cut],
            np.stack([corner[0], new, corner[2]], axis=1),
            np.stack([new, corner[1], corner[2]], axis=1),
        ])  # fmt: skip
    return v, f.astype(np.int32)

"""Array work on triangle surfaces: edges, rims, neighbours, distances."""

from typing import TypeGuard

import numpy as np

from proxcgal.core.typing import Array, Ints


def is_number(value: object) -> TypeGuard[float]:
    """Whether it is one number, of Python or of numpy; NaN is one."""
    return isinstance(value, int | float | np.integer | np.floating)


def compact(vertices: Array, triangles: Ints) -> tuple[Array, Ints]:
    """Leave out the vertices that no triangle uses."""
    used, rows = np.unique(triangles, return_inverse=True)
    return vertices[used], rows.reshape(-1, 3).astype(np.int32)


def face_vectors(corners: Array) -> Array:
    """Normal of each triangle (f, 3, 3), as long as twice its area [m^2], (f, 3)."""
    return cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def double_areas(vertices: Array, triangles: Ints) -> Array:
    """Twice the area of each triangle [m^2], (f,)."""
    normal = face_vectors(vertices[triangles])
    return np.sqrt(dot(normal, normal))


def unit_normals(vertices: Array, triangles: Ints) -> tuple[Array, Array]:
    """Unit normals (f, 3) (zero where there is no area) and areas (f,) [m^2]."""
    normal = face_vectors(vertices[triangles])
    length = np.sqrt(dot(normal, normal))
    return normal / np.maximum(length, 1e-300)[:, None], length / 2


def half_edges(triangles: Ints) -> Ints:
    """The three sides of every triangle in turn, (3 f, 2)."""
    return np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])


def edges_of(triangles: Ints, n: int) -> tuple[Ints, Ints]:
    """Each edge once, smaller vertex first, (e, 2), and how many faces it has, (e,)."""
    keys = np.sort(half_edges(triangles), axis=1).astype(np.int64) @ np.array([n, 1])
    key, count = np.unique(keys, return_counts=True)
    return np.stack([key // n, key % n], axis=1), count


def rims(triangles: Ints, n: int) -> tuple[Ints, Ints]:
    """Sides that no second face shares, in their face's sense, (r, 2), and that face, (r,)."""
    sides = half_edges(triangles)
    key = np.sort(sides, axis=1).astype(np.int64) @ np.array([n, 1])
    _, index, count = np.unique(key, return_index=True, return_counts=True)
    single = index[count == 1]
    return sides[single], single % len(triangles)


def faces_per_vertex(triangles: Ints, n: int) -> tuple[Ints, Ints]:
    """Faces at vertex i are faces[start[i] : start[i + 1]]."""
    corner = triangles.ravel()
    order = np.argsort(corner, kind="stable")
    return np.searchsorted(corner[order], np.arange(n + 1)), order // 3


def gather(start: Ints, items: Ints, rows: Ints) -> tuple[Ints, Ints]:
    """All items[start[r] : start[r + 1]] for the rows in turn: (index into rows, item)."""
    size = start[rows + 1] - start[rows]
    index = np.repeat(np.arange(len(rows)), size)
    before = np.cumsum(size) - size
    return index, items[np.repeat(start[rows] - before, size) + np.arange(len(index))]


def point_triangle_distance(points: Array, corners: Array) -> Array:
    """Distance from points (n, 3) to one triangle (n, 3, 3) each [m].

    Source: C. Ericson, Real-time collision detection, 2005, section 5.1.5, by the nearer of the
    plane's foot, where it falls inside, and the three sides.
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = face_vectors(corners)
    square = dot(normal, normal)
    inside = square > 0
    best = np.full(len(points), np.inf)
    for s, e in ((a, b), (b, c), (c, a)):
        side, to = e - s, points - s
        share = dot(to, side) / np.maximum(dot(side, side), 1e-300)
        gap = to - np.clip(share, 0, 1)[:, None] * side
        best = np.minimum(best, dot(gap, gap))
        inside &= dot(cross(side, to), normal) >= 0
    height = dot(points - a, normal) ** 2 / np.maximum(square, 1e-300)
    return np.sqrt(np.where(inside, np.minimum(best, height), best))


def dot(a: Array, b: Array) -> Array:
    """Row by row, (n,)."""
    return np.asarray(a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2])


def cross(a: Array, b: Array) -> Array:
    """Row by row, (n, 3); several times as fast as numpy's general one."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


def sample(
    vertices: Array, triangles: Ints, spacing: float, corners: bool = True
) -> tuple[Array, Ints]:
    """Points spread over a surface, no more than about `spacing` apart [m], the same every time.

    Args:
        vertices: (v, 3) [m].
        triangles: (f, 3).
        spacing: what is smaller than this has no sample of its own [m].
        corners: sample the vertices too.

    Returns:
        points (n, 3) along the sides and in the faces, and the triangle of each (n,).
    """
    p = vertices[triangles]
    points, owners = [], []
    if corners:
        used, first = np.unique(triangles, return_index=True)
        points, owners = [vertices[used]], [first // 3]
    for k in range(3):
        side = p[:, (k + 1) % 3] - p[:, k]
        on, step, parts = _repeat(np.linalg.norm(side, axis=1) / spacing)
        points.append(p[on, k] + ((step + 1) / (parts + 1))[:, None] * side[on])
        owners.append(on)
    on, step, _ = _repeat(double_areas(vertices, triangles) / 2 / spacing**2 + 0.5)
    # Additive recurrence of the plastic number: even, without a random source.
    u, w = (0.5 + step * 0.7548776662466927) % 1, (0.5 + step * 0.5698402909980532) % 1
    root, w = np.sqrt(u)[:, None], w[:, None]
    points.append((1 - root) * p[on, 0] + root * (1 - w) * p[on, 1] + root * w * p[on, 2])
    owners.append(on)
    return np.concatenate(points), np.concatenate(owners)


def _repeat(times: Array) -> tuple[Ints, Ints, Ints]:
    """Each row floor(times) times: the row, which time it is, and how many there are."""
    count = times.astype(np.int64)
    row = np.repeat(np.arange(len(count)), count)
    return row, np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count), count[row]

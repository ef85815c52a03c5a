"""Polygons of a mesh file as triangles, concave ones too."""

from collections.abc import Sequence

import mapbox_earcut
import numpy as np

from proxcgal.core.errors import GeometryError
from proxcgal.core.typing import Array, Bools, Ints
from proxcgal.models.mesh.triangles import cross

# The triangles of a face cover its outline's area to this share, else it crosses itself.
_AREA_TOLERANCE = 1e-6
# Most corners of one face.
MAX_CORNERS = 10_000


def triangulated(points: Array, corners: Ints, counts: Ints, what: str) -> Ints:
    """Triangles (f, 3) of faces with three or more corners, in the order of the faces.

    A face whose fan from its first corner turns one way is split so; any other is cut by ears in
    the plane of its Newell normal (M. Held, FIST, Algorithmica 30, 2001; mapbox/earcut). Of an
    outline that crosses itself the fan is taken: it covers every point that the outline winds
    round, so that no part of the surface is lost.

    Args:
        points: (v, 3).
        corners: rows of `points`, face by face, (sum of counts,).
        counts: corners of each face (n,).
        what: the file, for messages.

    Raises:
        GeometryError: fewer than 3 corners or too many, no such vertex.
    """
    corners, counts = np.asarray(corners, np.int64), np.asarray(counts, np.int64)
    if len(counts) and (counts < 3).any():
        face = int(np.argmax(counts < 3))
        raise GeometryError(f"{what}: face {face} with {counts[face]} corners; 3 are needed")
    if len(counts) and counts.max() > MAX_CORNERS:
        face = int(np.argmax(counts))
        raise GeometryError(
            f"{what}: face {face} with {counts[face]} corners; at most {MAX_CORNERS} are taken"
        )
    start = np.cumsum(counts) - counts
    check_rows(corners, np.repeat(np.arange(len(counts)), counts), len(points), what)
    if (counts == 3).all():
        return corners.reshape(-1, 3)
    made, owner = (
        [corners[start[counts == 3][:, None] + np.arange(3)]],
        [np.flatnonzero(counts == 3)],
    )
    for n in np.unique(counts[counts > 3]):
        faces = np.flatnonzero(counts == n)
        rows = corners[start[faces][:, None] + np.arange(n)]
        fan = np.stack([np.zeros(n - 2, np.int64), np.arange(1, n - 1), np.arange(2, n)], axis=1)
        one_way = _fans_turn_one_way(points[rows])
        made.append(rows[one_way][:, fan].reshape(-1, 3))
        owner.append(np.repeat(faces[one_way], n - 2))
        for face, outline in zip(faces[~one_way], rows[~one_way], strict=True):
            cut = cut_by_ears(points, [outline], f"{what}: face {face}")
            made.append(cut)
            owner.append(np.full(len(cut), face))
    order = np.argsort(np.concatenate(owner), kind="stable")
    return np.concatenate(made)[order]


def check_rows(rows: Ints, faces: Ints, count: int, what: str) -> None:
    """Refuse corners (n,) of `faces` (n,) that are no rows of `count` vertices.

    Raises:
        GeometryError: names the first such face.
    """
    if len(rows) and (rows.min() < 0 or rows.max() >= count):
        bad = int(np.argmax((rows < 0) | (rows >= count)))
        raise GeometryError(f"{what}: face {faces[bad]} has vertex {rows[bad]}; there are {count}")


def _fans_turn_one_way(outlines: Array) -> Bools:
    """Whether the fan from the first corner covers each outline (m, n, 3) once, (m,)."""
    m, n = outlines.shape[:2]
    with np.errstate(over="ignore", invalid="ignore"):
        spokes = outlines[:, 1:] - outlines[:, :1]
        parts = cross(spokes[:, :-1].reshape(-1, 3), spokes[:, 1:].reshape(-1, 3)).reshape(
            m, n - 2, 3
        )
        normal = parts.sum(axis=1)
        along = np.einsum("mki,mi->mk", parts, normal)
        square = np.einsum("mi,mi->m", normal, normal)
        # A fan that winds round its own centre more than once has no reflex corner to show it.
        rays = spokes / np.maximum(np.linalg.norm(spokes, axis=2), 1e-300)[..., None]
        turn = np.arccos(np.clip((rays[:, :-1] * rays[:, 1:]).sum(axis=2), -1, 1)).sum(axis=1)
        flat = np.linalg.norm(parts, axis=2).sum(axis=1) <= 1e-12 * (spokes**2).sum(axis=(1, 2))
        one_way = (along >= -_AREA_TOLERANCE * square[:, None]).all(axis=1)
    finite = np.isfinite(outlines).all(axis=(1, 2))  # what is not is refused later, by its row
    clear: Bools = ~finite | flat | (one_way & (square > 0) & (turn < 2 * np.pi))
    return clear


def cut_by_ears(points: Array, rings: Sequence[Ints], what: str) -> Ints:
    """Triangles (f, 3) of one outline and its holes, in the sense of the outline.

    Raises:
        GeometryError: an outline with holes that crosses itself or them.
    """
    rows = np.concatenate(rings)
    outline = points[rows]
    outline = outline - outline[0]
    normal, area = np.zeros(3), 0.0
    for k, ring in enumerate(rings):
        corner = points[ring] - points[rings[0][0]]
        part = cross(corner, np.roll(corner, -1, axis=0)).sum(axis=0)
        if k == 0:
            normal = part
        area += float(np.linalg.norm(part)) * (1 if k == 0 else -1)
    length = np.linalg.norm(normal)
    if not length > 0:
        return _covering(rings, what)
    normal = normal / length
    aside = np.eye(3)[np.argmin(np.abs(normal))]
    u = np.cross(aside, normal)
    u /= np.linalg.norm(u)
    plane = np.stack([outline @ u, outline @ np.cross(normal, u)], axis=1)
    plane = plane / np.abs(plane).max()
    ends = np.cumsum([len(ring) for ring in rings]).astype(np.uint32)
    cut = np.asarray(mapbox_earcut.triangulate_float64(plane, ends), np.int64).reshape(-1, 3)
    a, b, c = (outline[cut[:, k]] for k in range(3))
    signed = cross(b - a, c - a) @ normal
    cut[signed < 0] = cut[signed < 0, ::-1]
    if abs(np.abs(signed).sum() - area) > 10 * _AREA_TOLERANCE * area:
        return _covering(rings, what)
    return rows[cut]


def _covering(rings: Sequence[Ints], what: str) -> Ints:
    """The fan of an outline that crosses itself."""
    if len(rings) > 1:
        raise GeometryError(f"{what} has holes, and crosses itself; such faces are not read")
    ring = rings[0]
    return np.stack([np.full(len(ring) - 2, ring[0]), ring[1:-1], ring[2:]], axis=1)

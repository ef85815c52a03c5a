"""Simple shapes as closed surfaces of triangles."""

import numpy as np

from proxcgal.core.transforms import axes_along
from proxcgal.core.typing import Array, Ints

# A round shape is drawn with this many corners: at radius 0.2 m its facets lie within 0.3 mm.
_ROUND = 60
_SEGMENTS, _RINGS = 32, 8  # of a link's capsule: round its axis, and from a cap's rim to its pole


def box(size: Array) -> tuple[Array, Ints]:
    """A box of the given full size (3,) [m] round the origin."""
    corner = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
             [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]  # fmt: skip
    return corner * size, np.array(faces)


def cylinder(radius: float, length: float) -> tuple[Array, Ints]:
    """A closed cylinder along z round the origin [m]."""
    return _turned([(0.0, -length / 2), (radius, -length / 2), (radius, length / 2),
                    (0.0, length / 2)])  # fmt: skip


def ellipsoid(radii: Array) -> tuple[Array, Ints]:
    """An ellipsoid with semi-axes (3,) [m] round the origin; a sphere where they are equal."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, _ROUND // 2 + 1)
    vertices, triangles = _turned(list(zip(np.cos(angle), np.sin(angle), strict=True)))
    return vertices * radii, triangles


def capsule(radius: float, length: float) -> tuple[Array, Ints]:
    """A capsule along z round the origin; `length` is that of its straight part [m]."""
    low = np.linspace(-np.pi / 2, 0, _ROUND // 4 + 1)
    profile = [(radius * np.cos(a), radius * np.sin(a) - length / 2) for a in low]
    return _turned(profile + [(r, -z) for r, z in reversed(profile)])


def _turned(profile: list[tuple[float, float]]) -> tuple[Array, Ints]:
    """A profile of (radius, z), from the axis to the axis, turned about z."""
    angle = 2 * np.pi * np.arange(_ROUND) / _ROUND
    rings = [np.stack([r * np.cos(angle), r * np.sin(angle), np.full(_ROUND, z)], axis=1)
             for r, z in profile[1:-1]]  # fmt: skip
    poles = np.array([[0.0, 0.0, profile[0][1]], [0.0, 0.0, profile[-1][1]]])
    return _closed(rings, poles)


def capsule_between(start: Array, end: Array, radius: float) -> tuple[Array, Ints]:
    """A closed surface of a capsule: vertices (v, 3) [m], all on it, and triangles (f, 3)."""
    axis, *across = axes_along(end - start, (0.0, 0.0, 1.0))
    latitude = np.linspace(0.0, np.pi / 2, _RINGS + 1)[:-1]
    turn = 2 * np.pi * np.arange(_SEGMENTS) / _SEGMENTS
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    rows = [(start, -np.sin(a), np.cos(a)) for a in latitude[::-1]]
    rows += [(end, np.sin(a), np.cos(a)) for a in latitude]
    if not np.any(start != end):  # a sphere: its rim stands once
        rows.pop(_RINGS)
    rings = [
        middle + radius * (high * axis + wide * circle @ np.stack(across))
        for middle, high, wide in rows
    ]
    vertices, triangles = _closed(rings, np.stack([start - radius * axis, end + radius * axis]))
    return vertices, triangles.astype(np.int32)


def _closed(rings: list[Array], poles: Array) -> tuple[Array, Ints]:
    """A surface of rings of n points each, from low to high, closed by the poles (2, 3)."""
    vertices, n = np.concatenate([*rings, poles]), len(rings[0])
    here = np.arange(n)
    there = (here + 1) % n
    south, north, top = len(vertices) - 2, len(vertices) - 1, (len(rings) - 1) * n
    faces = [np.stack([np.full(n, south), there, here], axis=1)]
    for ring in range(len(rings) - 1):
        a, b = ring * n + here, ring * n + there
        c, d = a + n, b + n
        faces += [np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)]
    faces.append(np.stack([np.full(n, north), top + here, top + there], axis=1))
    return vertices, np.concatenate(faces)

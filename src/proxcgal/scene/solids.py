"""Shapes of a scene: their surface exactly, as a core with a rounding, and as points.

Axis z, origin at the centre, metres. The surface is all that lies `rounding` from the core's
triangles: a capsule is its axis, rounded.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from proxcgal.core.typing import Array

Mesh = tuple[Array, NDArray[np.int32]]  # vertices_O (v, 3), triangles (f, 3)

#: Corner k of the unit cube has the bits of k as coordinates; two triangles a face, outward.
_CORNERS = np.array([[k & 1, k >> 1 & 1, k >> 2 & 1] for k in range(8)]) - 0.5
_TRIANGLES = np.array(
    [[0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5], [0, 1, 5], [0, 5, 4],
     [2, 6, 7], [2, 7, 3], [0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6]],
    np.int32,
)  # fmt: skip
_SIDES = 128  # of a cylinder's core, round it: at most 0.03 % of the radius outside of it
_THIN = 1e-6  # [m] width of what stands for a line or a point


class _Sharp:
    """A shape whose core is its surface."""

    __slots__ = ()
    rounding = 0.0  #: [m] between core and surface


@dataclass(frozen=True, slots=True)
class Box(_Sharp):
    """Edge lengths along x, y, z."""

    size: tuple[float, ...]

    @property
    def extent(self) -> Array:
        """(3,) half edge lengths of the box round it."""
        return 0.5 * np.asarray(self.size)

    def core(self) -> Mesh:
        """Its faces."""
        return _CORNERS * np.asarray(self.size), _TRIANGLES

    def points(self, spacing: float) -> Array:
        """(n, 3) points of the surface, at most `spacing` apart along its edges."""
        ticks = [_ticks(edge, spacing) for edge in self.size]
        faces = []
        for axis, edge in enumerate(self.size):
            u, v = (other for other in range(3) if other != axis)
            grid_u, grid_v = np.meshgrid(ticks[u], ticks[v], indexing="ij")
            for side in (-0.5 * edge, 0.5 * edge):
                face = np.full((grid_u.size, 3), side)
                face[:, u], face[:, v] = grid_u.ravel(), grid_v.ravel()
                faces.append(face)
        return np.unique(np.concatenate(faces), axis=0)  # edges belong to two faces

    def nearest(self, point_O: Array) -> Array:
        """(3,) the point of the solid nearest to a point."""
        return np.clip(point_O, -self.extent, self.extent)


@dataclass(frozen=True, slots=True)
class Cylinder(_Sharp):
    """With flat ends."""

    radius: float
    height: float

    @property
    def extent(self) -> Array:
        """(3,) half edge lengths of the box round it."""
        return np.array([self.radius, self.radius, 0.5 * self.height])

    def core(self) -> Mesh:
        """A prism round it: no point of the cylinder is outside."""
        angle = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
        radius, half = self.radius / np.cos(np.pi / _SIDES), 0.5 * self.height
        circle = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
        ends = [np.column_stack([circle, np.full(_SIDES, z)]) for z in (-half, half)]
        vertices = np.concatenate([*ends, [[0.0, 0.0, -half], [0.0, 0.0, half]]])
        low = np.arange(_SIDES)
        after = (low + 1) % _SIDES
        high, bottom, top = low + _SIDES, 2 * _SIDES, 2 * _SIDES + 1
        faces = [
            np.column_stack([low, after, after + _SIDES]),
            np.column_stack([low, after + _SIDES, high]),
            np.column_stack([after, low, np.full(_SIDES, bottom)]),
            np.column_stack([high, after + _SIDES, np.full(_SIDES, top)]),
        ]
        return vertices, np.concatenate(faces).astype(np.int32)

    def points(self, spacing: float) -> Array:
        """(n, 3) points of the surface, at most `spacing` apart along rings and axis."""
        side = _tube(self.radius, _ticks(self.height, spacing), spacing)
        radii = np.linspace(0.0, self.radius, int(np.ceil(self.radius / spacing)) + 1)[:-1]
        disc = np.concatenate([_ring(radius, spacing) for radius in radii])
        half = 0.5 * self.height
        ends = [np.column_stack([disc, np.full(len(disc), z)]) for z in (-half, half)]
        return np.concatenate([side, *ends])

    def nearest(self, point_O: Array) -> Array:
        """(3,) the point of the solid nearest to a point."""
        out = np.array(point_O, np.float64)
        off = float(np.hypot(out[0], out[1]))
        if off > self.radius:
            out[:2] *= self.radius / off
        out[2] = np.clip(out[2], -0.5 * self.height, 0.5 * self.height)
        return out


class _Rounded:
    """All within `radius` of a segment along z of some length."""

    __slots__ = ()
    radius: float
    length: float

    @property
    def rounding(self) -> float:
        """[m] between core and surface."""
        return self.radius

    @property
    def extent(self) -> Array:
        """(3,) half edge lengths of the box round it."""
        return np.array([self.radius, self.radius, self.radius + 0.5 * self.length])

    def core(self) -> Mesh:
        """Its segment, a sliver 1 um wide."""
        half = 0.5 * self.length + 0.25 * _THIN
        ends = [[-0.5 * _THIN, 0.0, -half], [0.5 * _THIN, 0.0, -half], [0.0, 0.0, half]]
        return np.array(ends), np.array([[0, 1, 2]], np.int32)

    def points(self, spacing: float) -> Array:
        """(n, 3) points of the surface, at most `spacing` apart along rings and meridians."""
        half = 0.5 * self.length
        side = _tube(self.radius, _ticks(self.length, spacing), spacing)
        steps = max(int(np.ceil(0.5 * np.pi * self.radius / spacing)), 1)
        caps = []
        for angle in 0.5 * np.pi * np.arange(1, steps + 1) / steps:
            ring = _ring(self.radius * np.cos(angle), spacing)
            up = half + self.radius * np.sin(angle)
            caps += [np.column_stack([ring, np.full(len(ring), z)]) for z in (-up, up)]
        return np.concatenate([side, *caps])

    def nearest(self, point_O: Array) -> Array:
        """(3,) the point of the solid nearest to a point."""
        half = 0.5 * self.length
        center = np.array([0.0, 0.0, np.clip(point_O[2], -half, half)])
        apart = np.asarray(point_O) - center
        far = float(np.linalg.norm(apart))
        return np.asarray(center + apart * min(self.radius / max(far, _THIN), 1.0))


@dataclass(frozen=True, slots=True)
class CapsuleSolid(_Rounded):
    """All within `radius` of a segment of this length."""

    radius: float
    length: float


@dataclass(frozen=True, slots=True)
class Sphere(_Rounded):
    """All within `radius` of a point."""

    radius: float
    length: float = field(default=0.0, init=False, repr=False)


Solid = Box | Cylinder | CapsuleSolid | Sphere


def _ticks(edge: float, spacing: float) -> Array:
    return np.linspace(-0.5 * edge, 0.5 * edge, int(np.ceil(edge / spacing - 1e-9)) + 1)


def _ring(radius: float, spacing: float) -> Array:
    """(n, 2) round a circle."""
    n = max(int(np.ceil(2.0 * np.pi * radius / spacing - 1e-9)), 1)
    angle = 2.0 * np.pi * np.arange(n) / n
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def _tube(radius: float, heights: Array, spacing: float) -> Array:
    ring = _ring(radius, spacing)
    return np.concatenate([np.column_stack([ring, np.full(len(ring), z)]) for z in heights])

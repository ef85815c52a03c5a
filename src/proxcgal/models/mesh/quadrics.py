"""Quadric errors: the squared distance to many planes, as ten numbers a vertex.

Source: M. Garland and P. Heckbert, Surface simplification using quadric error metrics, 1997.
"""

import numpy as np

from proxcgal.core.typing import Array, Bools, Ints
from proxcgal.models.mesh.triangles import cross, dot, rims, unit_normals

# Pulls a new vertex to its edge's middle where the quadric leaves it free (flat or straight parts);
# without it the vertex may run off along the free direction.
_STABILITY = 1e-3


def surface_quadrics(vertices: Array, triangles: Ints) -> tuple[Array, Bools]:
    """Quadric of each vertex (v, 10), from its faces and rims, and which vertices are on a rim."""
    n = len(vertices)
    normal, area = unit_normals(vertices, triangles)
    Q = np.zeros((n, 10))
    face_q = _of_planes(normal, vertices[triangles[:, 0]], area / 3)
    for corner in range(3):
        np.add.at(Q, triangles[:, corner], face_q)
    # A rim has one face: planes that stand on it keep it in place.
    rim, rim_face = rims(triangles, n)
    along = vertices[rim[:, 1]] - vertices[rim[:, 0]]
    across = cross(along, normal[rim_face])
    across /= np.maximum(np.linalg.norm(across, axis=1), 1e-300)[:, None]
    rim_q = _of_planes(across, vertices[rim[:, 0]], (along**2).sum(1))
    for end in range(2):
        np.add.at(Q, rim[:, end], rim_q)
    on_rim = np.zeros(n, dtype=bool)
    on_rim[rim.ravel()] = True
    return Q, on_rim


def _of_planes(normal: Array, point: Array, weight: Array) -> Array:
    """Squared distance to each plane, as the ten numbers of a symmetric 4 x 4 matrix."""
    a, b, c = normal.T
    d = -dot(normal, point)
    products = [a * a, a * b, a * c, b * b, b * c, c * c, a * d, b * d, c * d, d * d]
    return np.asarray(weight[:, None] * np.stack(products, axis=1))


def cost(q: Array, x: Array) -> Array:
    """Area-weighted sum of squared distances of x (n, 3) to the planes of q (n, 10) [m^4]."""
    a, b, c = x.T
    return np.asarray(
        q[:, 0] * a * a + q[:, 3] * b * b + q[:, 5] * c * c + q[:, 9]
        + 2 * (q[:, 1] * a * b + q[:, 2] * a * c + q[:, 4] * b * c)
        + 2 * (q[:, 6] * a + q[:, 7] * b + q[:, 8] * c)
    )  # fmt: skip


def minimum(q: Array, middle: Array) -> Array:
    """Point of least cost, drawn to `middle` a little: (A + s I) x = s middle - b."""
    pull = _STABILITY * (q[:, 0] + q[:, 3] + q[:, 5]) + 1e-30
    xx, yy, zz = q[:, 0] + pull, q[:, 3] + pull, q[:, 5] + pull
    xy, xz, yz = q[:, 1], q[:, 2], q[:, 4]
    right = pull[:, None] * middle - q[:, 6:9]
    c0 = np.stack([yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy], axis=1)
    c1 = np.stack([c0[:, 1], xx * zz - xz * xz, xy * xz - xx * yz], axis=1)
    c2 = np.stack([c0[:, 2], c1[:, 2], xx * yy - xy * xy], axis=1)
    determinant = xx * c0[:, 0] + xy * c0[:, 1] + xz * c0[:, 2]
    rows = [dot(c, right) for c in (c0, c1, c2)]
    with np.errstate(divide="ignore", invalid="ignore"):
        x = np.stack(rows, axis=1) / determinant[:, None]
    return np.where(np.isfinite(x), x, middle)

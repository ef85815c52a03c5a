"""Capsules fitted to links, so that each link lies inside of its own."""

import numpy as np

from proxcgal._core import Capsule, LinkCapsule
from proxcgal.core.transforms import axes_along
from proxcgal.core.typing import Array
from proxcgal.models.robots import Robot

_ROUNDING = 1e-12  # [m] by which a fitted radius is widened, so that no vertex is outside by a bit
_UP = (0.0, 0.0, 1.0)  # an axis where there is none
_TINY = 1e-300  # stands in for the square of no length
_STEPS = (0.3, 0.1, 0.03, 0.01, 0.003, 0.001)  # of the search: share of the mesh's size, and [rad]


def fit_capsules(robot: Robot) -> list[LinkCapsule]:
    """A capsule for each link of a robot, in its frame, that contains the link's full mesh.

    Args:
        robot: any, as `load_robot` gives it.

    Returns:
        one for each of `link_names`, under the link's name.
    """
    return [
        LinkCapsule(name, row, fit_capsule(robot.full_mesh(name)[0]))
        for row, name in enumerate(robot.link_names)
    ]


def fit_capsule(vertices: Array) -> Capsule:
    """A small capsule that contains these points, and with them every triangle between them.

    Searched from the principal axes by small turns and shifts of the axis: it need not be the
    smallest there is, but it contains them all.

    Args:
        vertices: (v, 3) [m], finite, at least one.
    """
    points = np.asarray(vertices, np.float64)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    axes = (
        np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2] if size else np.eye(3)
    )
    best = min((_improved(points, middle, axis, size) for axis in axes), key=lambda found: found[0])
    _, start, end, _ = best
    # The radius once more, from the ends as they are: nothing may be outside by a rounding.
    along = end - start
    share = np.clip((points - start) @ along / max(float(along @ along), _TINY), 0.0, 1.0)
    apart = np.linalg.norm(points - start - share[:, None] * along, axis=1)
    return Capsule(start, end, float(apart.max()) + _ROUNDING)


_Fit = tuple[float, Array, Array, float]


def _improved(points: Array, middle: Array, axis: Array, size: float) -> _Fit:
    """The least volume that turning and shifting this axis leads to."""
    best = _around(points, middle, axis)
    for step in _STEPS:
        moved = True
        while moved:
            moved = False
            across = axes_along(axis, _UP)[1:]
            for side in (*across, *-across):
                for other, direction in (
                    (middle + step * size * side, axis), (middle, axis + step * side)
                ):  # fmt: skip
                    found = _around(points, other, direction)
                    if found[0] < best[0] * (1 - 1e-6):
                        best, middle, axis, moved = found, other, direction, True
    return best


def _around(points: Array, middle: Array, axis: Array) -> _Fit:
    """The least capsule on this line that contains the points, its volume first."""
    axis = axis / np.linalg.norm(axis)
    along = (points - middle) @ axis
    across = np.linalg.norm(points - middle - along[:, None] * axis, axis=1)
    radius = float(across.max())
    # A point may lie beyond the axis's ends by what the caps' roundness leaves at its height.
    room = np.sqrt(np.maximum(radius**2 - across**2, 0.0))
    low, high = float((along + room).min()), float((along - room).max())
    if low > high:  # all of it is in one ball, round any point between
        low = high = 0.5 * (low + high)
    volume = np.pi * radius**2 * (high - low + 4 / 3 * radius)
    return volume, middle + low * axis, middle + high * axis, radius

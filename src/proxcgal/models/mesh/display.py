"""Meshes that are looked at: about a thousand vertices a link, made once and kept."""

import numpy as np

from proxcgal.core.typing import Array, Ints
from proxcgal.models.mesh.resolution import COUNT_TOLERANCE, control_mesh
from proxcgal.models.robots import Robot, once_per_robot

#: Of a link's mesh on a page: those of the controller's usual mesh, which is there already.
DISPLAY_VERTICES = 1000
_DEVIATION = 0.002  # [m] as a robot's control meshes are made where nothing else is asked for


@once_per_robot
def display_meshes(robot: Robot, vertices: int = DISPLAY_VERTICES) -> list[tuple[Array, Ints]]:
    """A light mesh of each link: vertices_L (v, 3) [m] and triangles (f, 3), from the cache.

    Within 2 mm of the full one where so many vertices are enough for that; nothing is computed on
    them.

    Args:
        robot: its links, in the order of link_names.
        vertices: of a link, at most.
    """
    return [_light(*robot.full_mesh(link), vertices) for link in robot.link_names]


def _light(vertices_L: Array, triangles: Ints, count: int) -> tuple[Array, Ints]:
    if len(vertices_L) <= count:
        return vertices_L, triangles
    made = control_mesh(vertices_L, triangles, count, _DEVIATION)
    if len(made.vertices_L) > (1.0 + COUNT_TOLERANCE) * count:
        made = control_mesh(vertices_L, triangles, count, np.inf)
    return made.vertices_L, made.triangles

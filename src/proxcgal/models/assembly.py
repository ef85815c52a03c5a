"""One chain out of two, and bodies put on a link."""

import os
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from proxcgal.core.errors import GeometryError, ModelError
from proxcgal.core.transforms import placed
from proxcgal.core.typing import Array, Ints
from proxcgal.models.joining import joined, rigid
from proxcgal.models.mesh.files import check_mesh, clean_mesh, load_mesh
from proxcgal.models.mesh.resolution import ControlMesh, check_resolution, control_mesh
from proxcgal.models.robots import Robot

MeshSource = str | os.PathLike[str] | tuple[ArrayLike, ArrayLike]


def attach(
    robot: Robot, link: str, other: Robot, pose: ArrayLike, prefix: str | tuple[str, str]
) -> Robot:
    """Put another robot on a link of this one: one chain with the joints of both.

    Args:
        robot: keeps its place; its joints come first.
        link: the link, or named frame (a flange, a tool), of `robot` that carries the other.
        other: its tool becomes the tool.
        pose: (4, 4) of the other's base frame in that link's frame [m].
        prefix: put before the names of the other's joints, links and frames; of two, the first is
            for `robot`.

    Raises:
        ModelError: no robot, no such link, a pose or prefix that is none, or names that are not
            unique in the end.
    """
    for name, given in (("robot", robot), ("other", other)):
        if not isinstance(given, Robot):
            raise ModelError(
                f"{name} = {str(given)[:80]!r}: a Robot is needed, as load_robot gives it"
            )
    prefixes = ("", prefix) if isinstance(prefix, str) else prefix
    texts = isinstance(prefixes, tuple) and all(isinstance(text, str) for text in prefixes)
    if not texts or len(prefixes) != 2:
        raise ModelError(f"prefix = {prefix!r}; a text, or two, is needed")
    one, order = joined(robot.description, link, other.description, pose, prefixes)
    control = (*robot.control, *other.control)
    return Robot(one, [control[row] for row in order])


def attach_mesh(
    robot: Robot,
    link: str,
    mesh: MeshSource,
    pose: ArrayLike | None = None,
    *,
    vertices: int | None = 1000,
    max_deviation: float = 0.002,
) -> Robot:
    """Put a body (gripper, payload, cover) on a link: it is body to the filter and to distances.

    Args:
        robot: is left as it is.
        link: the link that carries the body.
        mesh: path of a mesh file, or (vertices (v, 3) [m], triangles (f, 3)).
        pose: (4, 4) of the body's frame in the link's; the same frame where None [m].
        vertices: that the body adds to the controller's mesh at most; None keeps all.
        max_deviation: how far its surface may move by that [m].

    Returns:
        a robot whose link has the body in its full and in its control mesh.

    Raises:
        ModelError: no such link, a pose that is none.
        GeometryError: a mesh that cannot be used.
        ConfigError: vertices or max_deviation out of bounds.
    """
    check_resolution("vertices", vertices, max_deviation)
    row = robot.description.link_row(link)
    T_LM = np.eye(4) if pose is None else rigid(pose, "pose")
    points, faces, dropped = _triangles_of(mesh)
    points = placed(T_LM, points)
    few = None if vertices is None or len(points) <= vertices else vertices
    coarse = control_mesh(points, faces, few, max_deviation)
    old, kept = robot.description.links[row], robot.control[row]
    full_vertices, full_triangles = _joined(old.vertices_L, old.triangles, points, faces)
    links = list(robot.description.links)
    links[row] = replace(
        old,
        vertices_L=full_vertices,
        triangles=full_triangles,
        dropped_faces=old.dropped_faces + dropped,
    )
    control = list(robot.control)
    control[row] = ControlMesh(
        *_joined(kept.vertices_L, kept.triangles, coarse.vertices_L, coarse.triangles),
        max(kept.deviation, coarse.deviation),
    )
    return Robot(replace(robot.description, links=tuple(links)), control)


def _triangles_of(mesh: MeshSource) -> tuple[Array, Ints, int]:
    if isinstance(mesh, str | os.PathLike):
        return clean_mesh(*load_mesh(mesh), str(mesh))
    try:
        vertices, triangles = (np.asarray(part) for part in mesh)
        if np.iscomplexobj(vertices):
            raise TypeError
        points = np.asarray(vertices, dtype=np.float64)
    except (TypeError, ValueError):
        raise GeometryError("mesh: a path, or (vertices, triangles) as arrays, is needed") from None
    if not np.issubdtype(triangles.dtype, np.integer):
        raise GeometryError(f"mesh: triangles are {triangles.dtype}; integers are needed")
    check_mesh(points, triangles, "mesh")
    return clean_mesh(points, triangles, "mesh")


def _joined(v: Array, f: Ints, w: Array, g: Ints) -> tuple[Array, Ints]:
    return np.concatenate([v, w]), np.concatenate([f, g + len(v)]).astype(np.int32)

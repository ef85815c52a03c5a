"""One chain out of two, and bodies put on a link."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from proxcgal.errors import GeometryError, ModelError
from proxcgal.models.description import Frame, Joint, Link, RobotDescription, listed
from proxcgal.models.meshes import check_mesh, clean, load_mesh
from proxcgal.models.resolution import ControlMesh, control_mesh
from proxcgal.models.robots import Robot
from proxcgal.models.triangles import Floats, Ints

Mesh = str | os.PathLike[str] | tuple[ArrayLike, ArrayLike]


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
        ModelError: no such link, a pose that is none, or names that are not unique in the end.
    """
    first, second = ("", prefix) if isinstance(prefix, str) else prefix
    where = robot.description.frame(link)
    T_JB = where.T_JF @ rigid(pose, "pose")
    own = renamed(robot.description, first)
    added = renamed(moved(other.description, T_JB, where.joint, robot.n_q), second)
    links = list(zip((*own.links, *added.links), (*robot.control, *other.control), strict=True))
    links.sort(key=lambda pair: pair[0].joint)
    joined = replace(
        own,
        name=f"{robot.name}_{other.name}",
        joints=(*own.joints, *added.joints),
        links=tuple(pair[0] for pair in links),
        frames=(*own.frames, *added.frames),
        tool=added.tool,
        source=f"{own.source} + {added.source}",
    )
    names: dict[str, Sequence[str]] = {
        "joint": joined.joint_names,
        "link": joined.link_names,
        "frame": [frame.name for frame in joined.frames],
    }
    for kind, all_names in names.items():
        if twice := [name for name, count in Counter(all_names).items() if count > 1]:
            raise ModelError(
                f"attach with prefix {prefix!r}: both robots have {kind} {listed(twice)}; a prefix "
                "that sets them apart is needed"
            )
    return Robot(joined, [pair[1] for pair in links])


def attach_mesh(
    robot: Robot,
    link: str,
    mesh: Mesh,
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
    """
    row = robot.description.link_row(link)
    T_LM = np.eye(4) if pose is None else rigid(pose, "pose")
    points, faces, dropped = _triangles_of(mesh)
    points = points @ T_LM[:3, :3].T + T_LM[:3, 3]
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


def rigid(pose: ArrayLike, what: str) -> Floats:
    """A (4, 4) rigid pose.

    Raises:
        ModelError: it is none.
    """
    T = np.asarray(pose, dtype=np.float64)
    if T.shape != (4, 4) or not np.isfinite(T).all():
        raise ModelError(f"{what} has shape {T.shape}; a finite (4, 4) pose is needed")
    R = T[:3, :3]
    turns = np.abs(R @ R.T - np.eye(3)).max() < 1e-6 and np.linalg.det(R) > 0
    if not turns or (T[3] != [0, 0, 0, 1]).any():
        raise ModelError(f"{what} is {T.tolist()}; a rotation and a translation are needed")
    return T


def renamed(description: RobotDescription, prefix: str) -> RobotDescription:
    """The same robot with `prefix` before the names of its joints, links and frames."""

    def name(part: Any) -> Any:
        return replace(part, name=prefix + part.name)

    return replace(
        description,
        joints=tuple(name(joint) for joint in description.joints),
        links=tuple(name(link) for link in description.links),
        frames=tuple(name(frame) for frame in description.frames),
        tool=prefix + description.tool,
    )


def moved(description: RobotDescription, T_JB: Floats, joint: int, offset: int) -> RobotDescription:
    """The robot hung on a joint of another: its rows shifted by `offset`, its base at T_JB."""

    def row(own: int) -> int:
        return joint if own < 0 else own + offset

    def placed(own: int, pose: Floats) -> Floats:
        return T_JB @ pose if own < 0 else pose

    joints: list[Joint] = [
        replace(j, parent=row(j.parent), origin=placed(j.parent, j.origin))
        for j in description.joints
    ]
    links: list[Link] = [
        replace(k, joint=row(k.joint), T_JL=placed(k.joint, k.T_JL)) for k in description.links
    ]
    frames: list[Frame] = [
        replace(f, joint=row(f.joint), T_JF=placed(f.joint, f.T_JF)) for f in description.frames
    ]
    return replace(description, joints=tuple(joints), links=tuple(links), frames=tuple(frames))


def _triangles_of(mesh: Mesh) -> tuple[Floats, Ints, int]:
    if isinstance(mesh, str | os.PathLike):
        return clean(*load_mesh(mesh), str(mesh))
    try:
        vertices, triangles = (np.asarray(part) for part in mesh)
        points = np.asarray(vertices, dtype=np.float64)
    except (TypeError, ValueError):
        raise GeometryError("mesh: a path, or (vertices, triangles), is needed") from None
    if not np.issubdtype(triangles.dtype, np.integer):
        raise GeometryError(f"mesh: triangles are {triangles.dtype}; integers are needed")
    check_mesh(points, triangles, "mesh")
    return clean(points, triangles, "mesh")


def _joined(v: Floats, f: Ints, w: Floats, g: Ints) -> tuple[Floats, Ints]:
    return np.concatenate([v, w]), np.concatenate([f, g + len(v)]).astype(np.int32)

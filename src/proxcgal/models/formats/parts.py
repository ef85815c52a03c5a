"""A description out of joints, frames and the links' shapes, for URDF and MJCF alike."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from proxcgal.core.errors import ModelError
from proxcgal.core.transforms import placed as place
from proxcgal.core.typing import Array, Ints
from proxcgal.models.description import Frame, Joint, Link, RobotDescription, listed
from proxcgal.models.mesh.files import clean_mesh, load_mesh

Kind = Literal["revolute", "prismatic"]
# The frame that the base stands in, where it has no link of its own.
WORLD = "world"
# A tool frame by these names is taken where the user names none, the first of them that is there.
TOOL_NAMES = ("tool0", "TCP", "tcp", "tool", "ee_link", "flange", "attachment_site")


@dataclass(frozen=True, slots=True)
class Shape:
    """One piece of a link: a mesh file or triangles, and where they stand in the link frame."""

    pose: Array  # (4, 4)
    file: Path | None = None
    scale: Array | None = None  # (3,), of the file
    mesh: tuple[Array, Ints] | None = None
    before_scale: Array | None = None  # (4, 4), of the file's vertices before they are scaled


def build_link_mesh(
    parts: Sequence[Shape], link: str, cache: dict[Path, tuple[Array, Ints]]
) -> tuple[Array, Ints, int]:
    """One clean mesh in the link frame out of a link's shapes.

    Returns:
        vertices_L (v, 3) [m], triangles (f, 3), and how many faces without area were left out.

    Raises:
        GeometryError: a mesh that cannot be used; names its file.
    """
    vertices, triangles, count = [], [], 0
    for part in parts:
        if part.file is not None:
            if part.file not in cache:
                cache[part.file] = load_mesh(part.file)
            points, faces = cache[part.file]
        else:
            assert part.mesh is not None
            points, faces = part.mesh
        # `clean_mesh` refuses what is not finite.
        with np.errstate(over="ignore", invalid="ignore"):
            if part.before_scale is not None:
                points = place(part.before_scale, points)
            if part.scale is not None:
                points = points * part.scale
                if np.prod(np.sign(part.scale)) < 0:  # mirrored: turn the faces back
                    faces = faces[:, ::-1]
            vertices.append(place(part.pose, points))
        triangles.append(faces + count)
        count += len(points)
    files = sorted({str(part.file) for part in parts if part.file})
    what = f"link '{link}'" + (f" ({', '.join(files)})" if files else "")
    return clean_mesh(np.concatenate(vertices), np.concatenate(triangles), what)


def assembled(
    shapes: Mapping[str, Sequence[Shape]],
    joints: Sequence[Joint],
    frames: Sequence[Frame],
    *,
    ends: Sequence[str],
    name: str,
    source: Path,
    base: str,
    notes: Sequence[str] = (),
) -> RobotDescription:
    """A description whose world is the frame of `base`, without its locked joints.

    Args:
        shapes: by the name of the link.
        joints: parents before children, in the file's own root frame.
        frames: of every link and site, in the same.
        ends: frames of the links that carry no other.
        name: of the robot.
        source: the file, for messages.
        base: link whose frame becomes the world.
        notes: what the user is to be warned of.

    Raises:
        ModelError: no joint, or a base that moves or does not exist.
        GeometryError: a mesh that cannot be used.
    """
    if not joints:
        raise ModelError(f"{source}: no moving joint")
    known = {frame.name: frame for frame in frames}
    if base == WORLD or WORLD in shapes:
        known.setdefault(WORLD, Frame(name=WORLD, joint=-1, T_JF=np.eye(4)))
    if base not in known:
        raise ModelError(f"{source}: no link '{base}' to stand on; there are {listed(known)}")
    if (moved_by := known[base].joint) >= 0:
        raise ModelError(
            f"{source}: link '{base}' is moved by joint '{joints[moved_by].name}', so it can be no "
            "base"
        )
    T_WU = np.linalg.inv(known[base].T_JF)
    based = tuple(replace(f, T_JF=T_WU @ f.T_JF) if f.joint < 0 else f for f in known.values())
    standing = tuple(replace(j, origin=T_WU @ j.origin) if j.parent < 0 else j for j in joints)
    free, kept, locked = without_locked(standing, based)
    if not free:
        raise ModelError(f"{source}: no moving joint; {listed(locked)} are locked (lower = upper)")
    links = _links(shapes, kept)
    if not links:
        raise ModelError(f"{source}: no link has a mesh or shape: nothing to keep away from things")
    moving = {frame.name for frame in kept if frame.joint >= 0}
    leaves = tuple(end for end in ends if end in moving)
    said = [f"joint {listed(locked)}: lower = upper, taken as fixed"] if locked else []
    return RobotDescription(
        name=name,
        joints=free,
        links=tuple(links),
        frames=kept,
        tool=_choose_tool(kept, leaves),
        source=str(source),
        ends=leaves,
        notes=(*notes, *said),
    )


def without_locked(
    joints: Sequence[Joint], frames: Sequence[Frame]
) -> tuple[tuple[Joint, ...], tuple[Frame, ...], list[str]]:
    """Joints and frames with every joint of one possible position made fixed there, and which."""
    where: list[tuple[int, Array]] = []  # of each joint's moving side: free joint, pose in it
    free: list[Joint] = []
    locked = []
    for joint in joints:
        parent, T = where[joint.parent] if joint.parent >= 0 else (-1, np.eye(4))
        origin = T @ joint.origin if joint.parent >= 0 else joint.origin
        if joint.q_min == joint.q_max:
            locked.append(joint.name)
            where.append((parent, origin @ motion(joint.type, joint.axis, joint.q_min)))
        else:
            where.append((len(free), np.eye(4)))
            free.append(replace(joint, parent=parent, origin=origin))
    if not locked:
        return tuple(joints), tuple(frames), []
    kept = tuple(
        replace(f, joint=where[f.joint][0], T_JF=where[f.joint][1] @ f.T_JF) if f.joint >= 0 else f
        for f in frames
    )
    return tuple(free), kept, locked


def motion(kind: Kind, a: Array, q: float) -> Array:
    """T (4, 4) of a joint's moving side in its frame at q, by its unit axis; Rodrigues' formula."""
    T = np.eye(4)
    if kind == "prismatic":
        T[:3, 3] = a * q
        return T
    K = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    T[:3, :3] += np.sin(q) * K + (1 - np.cos(q)) * K @ K
    return T


def _links(shapes: Mapping[str, Sequence[Shape]], frames: Sequence[Frame]) -> list[Link]:
    """Each link with its mesh, base first."""
    files: dict[Path, tuple[Array, Ints]] = {}
    links = []
    for name, parts in shapes.items():
        vertices, triangles, dropped = build_link_mesh(parts, name, files)
        frame = next(f for f in frames if f.name == name)
        links.append(
            Link(
                name=name,
                joint=frame.joint,
                T_JL=frame.T_JF,
                vertices_L=vertices,
                triangles=triangles,
                dropped_faces=dropped,
            )
        )
    return sorted(links, key=lambda link: link.joint)


def _choose_tool(frames: Sequence[Frame], ends: Sequence[str]) -> str:
    """The frame that is called a tool, else the only link that carries no other, else none ("")."""
    names = {frame.name for frame in frames}
    for name in TOOL_NAMES:
        if name in names:
            return name
    return ends[0] if len(ends) == 1 else ""

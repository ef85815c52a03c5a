"""From pinocchio's model and the links' shapes to a description, for URDF and MJCF alike."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from proxcgal.core.errors import ModelError
from proxcgal.core.transforms import placed as place
from proxcgal.core.typing import Array, Ints
from proxcgal.models.description import Frame, Joint, Link, RobotDescription, listed
from proxcgal.models.mesh.files import clean_mesh, load_mesh

# The frame that the base stands in, where it has no link of its own.
WORLD = "world"
# A tool frame by these names is taken where the user names none.
TOOL_NAMES = ("tool0", "TCP", "tcp", "tool", "ee_link", "flange", "attachment_site")


@dataclass(frozen=True, slots=True)
class Shape:
    """One piece of a link: a mesh file or triangles, and where they stand in the link frame."""

    pose: Array  # (4, 4)
    file: Path | None = None
    scale: Array | None = None  # (3,), of the file
    mesh: tuple[Array, Ints] | None = None


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


def describe(
    model: Any,
    shapes: Mapping[str, Sequence[Shape]],
    *,
    name: str,
    source: Path,
    base: str,
    limits: Mapping[str, tuple[float, float]],
    speeds: Mapping[str, float],
) -> RobotDescription:
    """A description out of pinocchio's model and the links' shapes.

    Args:
        model: pinocchio.Model of revolute and prismatic joints.
        shapes: by the name of the link.
        name: of the robot.
        source: the file, for messages.
        base: link whose frame becomes the world.
        limits: position limits that are to replace the model's, by joint.
        speeds: speed limits, by joint; nan for those that are not there.

    Raises:
        ModelError: no joint, or a base that moves or does not exist.
        GeometryError: a mesh that cannot be used.
    """
    import pinocchio as pin  # here, because a warm cache does without it

    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    pin.updateFramePlacements(model, data)
    if model.njoints < 2:
        raise ModelError(f"{source}: no moving joint")
    bodies = {f.name: f for f in model.frames if f.type in
              (pin.FrameType.BODY, pin.FrameType.OP_FRAME)}  # fmt: skip
    bodies |= {f.name: f for f in model.frames if f.type == pin.FrameType.BODY}
    if base == WORLD or WORLD in shapes:
        bodies.setdefault(WORLD, model.frames[0])
    if base not in bodies:
        raise ModelError(f"{source}: no link '{base}' to stand on; there are {listed(bodies)}")
    if bodies[base].parentJoint:
        raise ModelError(
            f"{source}: link '{base}' is moved by joint "
            f"'{model.names[bodies[base].parentJoint]}', so it can be no base"
        )
    T_WU = np.linalg.inv(bodies[base].placement.homogeneous)

    def placed(joint: int, pose: Array) -> Array:
        return pose if joint else T_WU @ pose

    joints = [
        _joint(model, data, i, placed, limits, speeds, source) for i in range(1, model.njoints)
    ]
    frames = tuple(
        Frame(
            name=key,
            joint=f.parentJoint - 1,
            T_JF=placed(f.parentJoint, f.placement.homogeneous),
        )
        for key, f in bodies.items()
    )
    links = _links(shapes, frames)
    if not links:
        raise ModelError(f"{source}: no link has a mesh or shape: nothing to keep away from things")
    return RobotDescription(
        name=name,
        joints=tuple(joints),
        links=tuple(links),
        frames=frames,
        tool=_choose_tool(frames, joints),
        source=str(source),
    )


def _joint(
    model: Any,
    data: Any,
    row: int,
    placed: Callable[[int, Array], Array],
    limits: Mapping[str, tuple[float, float]],
    speeds: Mapping[str, float],
    source: Path,
) -> Joint:
    """One joint of pinocchio's model; `placed` brings what hangs on the universe to the base."""
    import pinocchio as pin  # as in `describe`

    name, kind, parent = model.names[row], model.joints[row], model.parents[row]
    if kind.nv != 1:
        raise ModelError(
            f"{source}: joint '{name}' has {kind.nv} degrees of freedom; revolute and prismatic "
            "joints are read"
        )
    jacobian = pin.getJointJacobian(model, data, row, pin.LOCAL).reshape(6, model.nv)
    motion = jacobian[:, kind.idx_v]
    linear = np.linalg.norm(motion[:3]) > 0.5
    axis = motion[:3] if linear else motion[3:]
    low, high = limits.get(
        name, (model.lowerPositionLimit[kind.idx_q], model.upperPositionLimit[kind.idx_q])
    )
    if kind.nq != 1:  # turns without end
        low, high = -np.inf, np.inf
    return Joint(
        name=name,
        type="prismatic" if linear else "revolute",
        parent=parent - 1,
        origin=placed(parent, model.jointPlacements[row].homogeneous),
        axis=axis / np.linalg.norm(axis),
        q_min=float(low),
        q_max=float(high),
        qd_max=speeds.get(name, np.nan),
        qdd_max=np.nan,
    )


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


def _choose_tool(frames: Sequence[Frame], joints: Sequence[Joint]) -> str:
    """The frame that is called a tool, else the last one of the only chain, else none ("")."""
    names = {frame.name for frame in frames}
    for name in TOOL_NAMES:
        if name in names:
            return name
    ends = set(range(len(joints))) - {joint.parent for joint in joints}
    last = [frame.name for frame in frames if frame.joint in ends]
    return last[-1] if len(ends) == 1 and last else ""

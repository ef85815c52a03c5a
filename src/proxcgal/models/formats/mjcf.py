"""MJCF to a robot description.

pinocchio reads the kinematics. It passes over in silence what it does not know (a second body at
the top, frames, switched-off limits), so all of that is looked for first, and refused by name.
"""

import math
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np

from proxcgal.core.errors import ModelError
from proxcgal.models.description import listed
from proxcgal.models.formats.paths import MeshFolders
from proxcgal.models.formats.pinocchio_model import WORLD, Shape
from proxcgal.models.formats.safe_xml import is_direction, parse_numbers
from proxcgal.models.mesh.shapes import box, capsule, cylinder, ellipsoid

_NOT_READ = ("include", "frame", "replicate", "attach", "composite", "flexcomp", "plugin")
_NUMBERS = {"pos": 3, "quat": 4, "axis": 3, "euler": 3, "xyaxes": 6, "zaxis": 3, "axisangle": 4}


def check_structure(root: ET.Element, path: Path, folders: MeshFolders) -> list[Path]:
    """See that pinocchio reads all of it, and that its mesh files are there.

    Returns:
        the mesh files.

    Raises:
        ModelError: names what is not read, or the file and the body that needs it.
    """
    for tag in _NOT_READ:
        if (element := root.find(f".//{tag}")) is not None:
            given = element.get("name") or element.get("file")
            raise ModelError(
                f"{path}: <{tag}{f' {given}' if given else ''}> is not read; save the compiled "
                "model (mj_saveLastXML) and load that"
            )
    for compiler in root.findall("compiler"):
        if compiler.get("coordinate", "local") != "local":
            raise ModelError(f"{path}: compiler coordinate '{compiler.get('coordinate')}'; "
                             "only local coordinates are read")  # fmt: skip
    if (joint := root.find("equality/joint")) is not None:
        raise ModelError(
            f"{path}: joint '{joint.get('joint1')}' is bound to '{joint.get('joint2')}' "
            "(equality); joints that follow others are not read: take a model without that part "
            "and put it on with attach_mesh"
        )
    top = root.findall("worldbody/body")
    if len(top) != 1:
        raise ModelError(
            f"{path}: bodies {listed(b.get('name', '?') for b in top)} stand side by side in the "
            "world; one is read, the base"
        )
    names: set[str] = set()
    for body in top[0].iter("body"):
        _check_body(body, names, path)
    return _check_meshes(root, path, folders)


def _check_body(body: ET.Element, names: set[str], path: Path) -> None:
    if not (name := body.get("name", "")):
        raise ModelError(f"{path}: a <body> without a name")
    if name in names:
        raise ModelError(f"{path}: two bodies are called '{name}'")
    names.add(name)
    joints = body.findall("joint")
    free = body.findall("freejoint") + [j for j in joints if j.get("type") in ("free", "ball")]
    if free:
        raise ModelError(
            f"{path}: joint '{free[0].get('name', '?')}' of body '{name}' is "
            f"{free[0].get('type', 'free')}; hinge and slide joints are read"
        )
    if len(joints) > 1:
        raise ModelError(
            f"{path}: body '{name}' has joints {listed(j.get('name', '?') for j in joints)}; one a "
            "body is read: put a body between them"
        )
    for element in [body, *joints, *body.findall("geom"), *body.findall("site")]:
        for key, count in _NUMBERS.items():
            if key in element.attrib:
                what = (
                    f"{path}: <{element.tag}> '{element.get('name', '')}' in body '{name}', {key}"
                )
                values = parse_numbers(element.get(key, ""), count, what)
                if key in ("axis", "quat") and not is_direction(values):
                    raise ModelError(f"{what} is all zeros, or nearly; a direction is needed")
    for joint in joints:
        if not joint.get("name"):
            raise ModelError(f"{path}: body '{name}' has a joint without a name")


def _check_meshes(root: ET.Element, path: Path, folders: MeshFolders) -> list[Path]:
    directory = ""
    for compiler in root.findall("compiler"):
        directory = compiler.get("meshdir", compiler.get("assetdir", directory))
    base = folders.own[0] / directory
    files = []
    for mesh in root.findall("asset/mesh"):
        if file := mesh.get("file"):
            name = mesh.get("name") or Path(file).stem
            if moved := [key for key in ("refpos", "refquat") if key in mesh.attrib]:
                raise ModelError(f"{path}: mesh '{name}' has {moved[0]}, which is not read")
            users = [
                body.get("name", "?")
                for body in root.iter("body")
                if any(geom.get("mesh") == name for geom in body.findall("geom"))
            ]
            what = f"mesh '{name}'" + (f" of link {listed(users)}" if users else "")
            files.append(folders.find(file, what, base))
    return files


def position_limits(root: ET.Element, model: Any) -> dict[str, tuple[float, float]]:
    """Position limits where pinocchio reads them otherwise than MuJoCo does.

    It turns the range of a slide joint from degrees too, and keeps a range that is switched off.
    """
    degrees = True
    for compiler in root.findall("compiler"):
        degrees = compiler.get("angle", "degree" if degrees else "radian") == "degree"
    elements = {j.get("name"): j for j in root.iter("joint") if j.get("name")}
    found = {}
    for i in range(1, model.njoints):
        name, joint = model.names[i], model.joints[i]
        low = float(model.lowerPositionLimit[joint.idx_q])
        high = float(model.upperPositionLimit[joint.idx_q])
        if name in elements and elements[name].get("limited") == "false":
            low, high = -math.inf, math.inf
        elif joint.shortname().startswith("JointModelP") and degrees:
            low, high = math.degrees(low), math.degrees(high)
        found[name] = (low, high)
    return found


def shapes(model: Any, path: Path, root: ET.Element) -> dict[str, list[Shape]]:
    """What each body looks like: its visual geoms, or all it has where none is only visual.

    Raises:
        ModelError: a shape that is not read; a body that pinocchio has lost.
    """
    import pinocchio as pin  # here, because a warm cache does without it

    bodies = {f.name for f in model.frames if f.type == pin.FrameType.BODY}
    if lost := [b.get("name", "") for b in root.iter("body") if b.get("name") not in bodies]:
        raise ModelError(f"{path}: bodies {listed(lost)} could not be read")
    seen, solid = (
        list(pin.buildGeomFromMJCF(model, str(path), kind).geometryObjects)
        for kind in (pin.GeometryType.VISUAL, pin.GeometryType.COLLISION)
    )
    solid_names = {geom.name for geom in solid}
    by_link: dict[str, list[list[Any]]] = {}
    for rank, geoms in enumerate(
        ([g for g in seen if g.name not in solid_names], seen, solid),
    ):
        for geom in geoms:
            link = model.frames[geom.parentFrame].name
            by_link.setdefault(link, [[], [], []])[rank].append(geom)
    found = {}
    for link, ranks in by_link.items():
        first = next(geoms for geoms in ranks if geoms)
        parts = [part for geom in first if (part := _shape(geom, model, link, path))]
        if parts:
            found[WORLD if link == "universe" else link] = parts
    return found


def _shape(geom: Any, model: Any, link: str, path: Path) -> Shape | None:
    pose = (model.frames[geom.parentFrame].placement.inverse() * geom.placement).homogeneous
    shape, kind = geom.geometry, type(geom.geometry).__name__
    if kind in ("Halfspace", "Plane"):
        return None  # the floor: no part of the robot
    if kind == "Box":
        return Shape(pose, mesh=box(2 * np.asarray(shape.halfSide)))
    if kind == "Cylinder":
        return Shape(pose, mesh=cylinder(shape.radius, 2 * shape.halfLength))
    if kind == "Capsule":
        return Shape(pose, mesh=capsule(shape.radius, 2 * shape.halfLength))
    if kind == "Sphere":
        return Shape(pose, mesh=ellipsoid(np.full(3, shape.radius)))
    if kind == "Ellipsoid":
        return Shape(pose, mesh=ellipsoid(np.asarray(shape.radii)))
    if Path(geom.meshPath).is_file():
        return Shape(pose, file=Path(geom.meshPath), scale=np.asarray(geom.meshScale).copy())
    raise ModelError(f"{path}: link '{link}' has a {kind} that is not read")

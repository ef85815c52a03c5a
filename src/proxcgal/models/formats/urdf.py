"""URDF (and xacro) to a robot description.

The structure is checked before pinocchio sees it, which takes a link with two parents, or a cycle,
and returns a shorter robot. What pinocchio gets holds links and joints only.
"""

import math
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from proxcgal.core.errors import GeometryError, ModelError
from proxcgal.core.transforms import pose
from proxcgal.core.typing import Array
from proxcgal.models.description import listed
from proxcgal.models.formats.parts import Shape
from proxcgal.models.formats.paths import MeshFolders
from proxcgal.models.formats.safe_xml import is_direction, parse_number, parse_numbers
from proxcgal.models.mesh.shapes import box, cylinder, ellipsoid

MAX_LINKS = 1000
_AXIS = "1 0 0"  # where none is given
_MOVING = {"revolute", "continuous", "prismatic"}
_REFUSED = {
    "floating": "moves freely",
    "planar": "moves in a plane",
    "ball": "turns about three axes",
}


def check_structure(root: ET.Element, path: Path) -> None:
    """See that the links form one tree and every joint says all that is needed.

    Raises:
        ModelError: names the links and joints concerned.
    """
    links = [_name(e, "link", path) for e in root.findall("link")]
    joints = {}
    for element in root.findall("joint"):
        name = _name(element, "joint", path)
        if name in joints:
            raise ModelError(f"{path}: two joints are called '{name}'")
        joints[name] = element
    if max(len(links), len(joints)) > MAX_LINKS:
        raise ModelError(
            f"{path}: {len(links)} links, {len(joints)} joints; at most {MAX_LINKS} are read"
        )
    if twice := [name for name, count in Counter(links).items() if count > 1]:
        raise ModelError(f"{path}: more than one link is called {listed(twice)}")
    if not links:
        raise ModelError(f"{path}: no links")
    known = set(links)
    parent_of: dict[str, tuple[str, str]] = {}  # child link -> (joint, parent link)
    for name, element in joints.items():
        parent, child = (_link_of(element, end, name, path) for end in ("parent", "child"))
        for link in (parent, child):
            if link not in known:
                raise ModelError(
                    f"{path}: joint '{name}' names link '{link}', which does not exist; there are "
                    f"{listed(links)}"
                )
        if child in parent_of:
            other, first = parent_of[child]
            raise ModelError(
                f"{path}: link '{child}' has two parents: '{first}' by joint '{other}' and "
                f"'{parent}' by joint '{name}'"
            )
        parent_of[child] = (name, parent)
        _check_joint(element, name, path)
    _check_tree(links, parent_of, path)


def _check_tree(links: Sequence[str], parent_of: dict[str, tuple[str, str]], path: Path) -> None:
    for link in links:
        chain = [link]
        while chain[-1] in parent_of:
            chain.append(parent_of[chain[-1]][1])
            if chain[-1] == link:
                loop = [parent_of[name][0] for name in chain[:-1]]
                raise ModelError(
                    f"{path}: links {listed(chain[:-1])} form a cycle (joints {listed(loop)})"
                )
            if len(chain) > len(links):
                break  # runs into a cycle of others, found at one of those
    roots = [link for link in links if link not in parent_of]
    if len(roots) != 1:
        raise ModelError(
            f"{path}: links {listed(roots)} have no parent; exactly one link, the base, may"
        )


def _check_joint(element: ET.Element, name: str, path: Path) -> None:
    kind = element.get("type", "")
    what = f"{path}: joint '{name}'"
    if kind in _REFUSED:
        raise ModelError(
            f"{what} is {kind} ({_REFUSED[kind]}); revolute, continuous, prismatic and fixed "
            "joints are read"
        )
    if kind not in _MOVING | {"fixed"}:
        raise ModelError(
            f"{what} has type '{kind}'; revolute, continuous, prismatic and fixed are read"
        )
    _origin(element, what)
    if kind == "fixed":
        return
    if (mimic := element.find("mimic")) is not None:
        raise ModelError(
            f"{what} follows joint '{mimic.get('joint')}' (mimic); joints that follow others are "
            "not read: make it fixed, or put the part on with attach_mesh"
        )
    if not is_direction(_axis(element, what)):
        raise ModelError(f"{what} has axis 0 0 0; a direction is needed")
    limit = element.find("limit")
    if limit is None:
        if kind != "continuous":
            raise ModelError(f"{what} is {kind} and has no <limit>; lower and upper are needed")
        return
    lower, upper, _ = (
        parse_number(limit.get(key, "0"), f"{what}, limit {key}", math.inf)
        for key in ("lower", "upper", "velocity")
    )
    if kind != "continuous" and not lower <= upper:
        raise ModelError(f"{what} has lower limit {lower} and upper limit {upper}; lower <= upper")
    if kind != "continuous" and lower == upper and not math.isfinite(lower):
        raise ModelError(f"{what} is locked at {lower}; a finite number is needed")


def kinematics_only(root: ET.Element) -> str:
    """The URDF with its links and joints, without meshes, inertias and extensions."""
    out = ET.Element("robot", {"name": root.get("name") or "robot"})
    for link in root.findall("link"):
        ET.SubElement(out, "link", {"name": link.get("name", "")})
    for joint in root.findall("joint"):
        kept = ET.SubElement(out, "joint", dict(joint.attrib))
        for tag in ("origin", "parent", "child", "axis"):
            if (part := joint.find(tag)) is not None:
                ET.SubElement(kept, tag, dict(part.attrib))
                if tag == "axis":  # without numbers it is the default, not 0 0 0
                    kept[-1].set("xyz", part.get("xyz", _AXIS))
        if joint.get("type") != "fixed":
            limit = joint.find("limit")
            given = {} if limit is None else limit.attrib
            # Speed and effort are not taken from pinocchio, whose parser would complain by itself.
            bounds = {key: value for key, value in given.items() if key in ("lower", "upper")}
            ET.SubElement(kept, "limit", {"velocity": "0", "effort": "0", **bounds})
    return ET.tostring(out, encoding="unicode")


def speed_limits(root: ET.Element) -> dict[str, float]:
    """Speed limit of each joint that has one [rad/s or m/s]; 0 counts as none."""
    found = {}
    for joint in root.findall("joint"):
        limit = joint.find("limit")
        if limit is not None and float(limit.get("velocity", "0")) > 0:
            found[joint.get("name", "")] = float(limit.get("velocity", "0"))
    return found


def ends(root: ET.Element) -> tuple[str, list[str]]:
    """The link that no joint carries, and the links that carry no other."""
    carried, carrying = (
        {end.get("link") for end in root.findall(f"joint/{tag}")} for tag in ("child", "parent")
    )
    names = [element.get("name", "") for element in root.findall("link")]
    return (
        next(name for name in names if name not in carried),
        [name for name in names if name not in carrying],
    )


def shapes(root: ET.Element, folders: MeshFolders) -> tuple[dict[str, list[Shape]], list[str]]:
    """What each link looks like: its visuals, or its collision shapes where it has no visual.

    Placeholders, shapes with a size of 0, are left out, with a note.

    Raises:
        ModelError: a mesh file that is missing or outside of its folders, a shape that is not read.
    """
    found = {}
    empty: dict[str, None] = {}
    for link in root.findall("link"):
        name = link.get("name", "")
        for tag in ("visual", "collision"):
            made = [_shape(e, name, folders) for e in link.findall(tag)]
            if any(part is _PLACEHOLDER for part in made):
                empty[name] = None
            if parts := [part for part in made if part and part is not _PLACEHOLDER]:
                found[name] = parts
                break
    notes = [f"link {listed(empty)}: a shape of size 0 is left out"] if empty else []
    return found, notes


# A shape that stands where there is none.
_PLACEHOLDER = Shape(np.eye(4))


def _shape(element: ET.Element, link: str, folders: MeshFolders) -> Shape | None:
    what = f"link '{link}'"
    where = f"{folders.description}: {what}"
    geometry = element.find("geometry")
    if geometry is None or not len(geometry):
        return None
    kind = geometry[0]
    T_LS = _origin(element, where)
    if kind.tag == "mesh":
        scale = parse_numbers(kind.get("scale", "1 1 1"), 3, f"{where}, mesh scale")
        if (scale == 0).all():
            return _PLACEHOLDER
        if (scale == 0).any():
            raise ModelError(f"{where} has mesh scale {scale.tolist()}; 0 leaves no surface")
        return Shape(T_LS, file=folders.find(kind.get("filename", ""), what), scale=scale)
    sizes = _sizes(kind, where)
    if (sizes < 0).any():
        raise GeometryError(
            f"{where} has a shape with size {sizes.tolist()}; more than 0 is needed"
        )
    if (sizes == 0).any():
        return _PLACEHOLDER
    if kind.tag == "box":
        return Shape(T_LS, mesh=box(sizes))
    if kind.tag == "cylinder":
        return Shape(T_LS, mesh=cylinder(*sizes))
    return Shape(T_LS, mesh=ellipsoid(np.repeat(sizes, 3)))


_SIZES = {"cylinder": ("radius", "length"), "sphere": ("radius",)}


def _sizes(kind: ET.Element, where: str) -> Array:
    """Size of a box (3,), radius and length of a cylinder (2,), radius of a sphere (1,) [m]."""
    if kind.tag == "box":
        return parse_numbers(kind.get("size", ""), 3, f"{where}, box size")
    if kind.tag in _SIZES:
        return np.array([parse_number(kind.get(key, ""), f"{where}, {kind.tag} {key}")
                         for key in _SIZES[kind.tag]])  # fmt: skip
    raise ModelError(f"{where} has shape <{kind.tag}>; mesh, box, cylinder, sphere are read")


def _origin(element: ET.Element, what: str) -> Array:
    """T (4, 4) of an <origin>."""
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    return pose(
        parse_numbers(origin.get("xyz", "0 0 0"), 3, f"{what}, origin xyz"),
        parse_numbers(origin.get("rpy", "0 0 0"), 3, f"{what}, origin rpy"),
    )


def _axis(element: ET.Element, what: str) -> Array:
    axis = element.find("axis")
    return parse_numbers(_AXIS if axis is None else axis.get("xyz", _AXIS), 3, f"{what}, axis")


def _name(element: ET.Element, tag: str, path: Path) -> str:
    if not (name := element.get("name", "")):
        raise ModelError(f"{path}: a <{tag}> without a name")
    return name


def _link_of(element: ET.Element, end: str, joint: str, path: Path) -> str:
    part = element.find(end)
    if part is None or not part.get("link"):
        raise ModelError(f"{path}: joint '{joint}' has no <{end} link=...>")
    return part.get("link", "")

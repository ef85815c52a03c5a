"""From a URDF, xacro or MJCF file to a description, by way of the cache."""

import os
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from proxcgal.core.cache import Cache, Stored, hash_file
from proxcgal.core.errors import ModelError, ProxError
from proxcgal.models.description import Frame, Joint, Link, RobotDescription
from proxcgal.models.formats import urdf
from proxcgal.models.formats.capsule_robot import read_capsule_robot
from proxcgal.models.formats.parts import WORLD, assembled
from proxcgal.models.formats.paths import ROBOT_SUFFIXES, MeshFolders, is_robot_file
from proxcgal.models.formats.pinocchio_model import joints_and_frames
from proxcgal.models.formats.safe_xml import parse_xml
from proxcgal.models.formats.xacro_expansion import checked_arguments, expand, still_holds
from proxcgal.models.mjcf.reader import read_mjcf

# Bump when what is read from the same files changes.
_VERSION = 2
_LIMITS = ("q_min", "q_max", "qd_max", "qdd_max")


def read_description(
    path: str | os.PathLike[str],
    package_dirs: Sequence[str | os.PathLike[str]] = (),
    base: str | None = None,
    packages: Mapping[str, Path] | None = None,
    xacro_args: Mapping[str, str | float | bool] | None = None,
) -> RobotDescription:
    """Read a robot description with its meshes at full resolution.

    Args:
        path: .urdf, .xacro, .xml (URDF or MJCF, told apart by the outermost tag), or .toml (a list
            of capsules).
        package_dirs: folders that package:// paths and meshes may lie in.
        base: link whose frame is the world. By default `base_link` where no joint moves it, else
            the first link of a URDF, the world of an MJCF.
        packages: folder of some packages, by name.
        xacro_args: arguments of a xacro, by name.

    Raises:
        ModelError: what cannot be read, with the file and the links or joints concerned.
        GeometryError: a mesh that cannot be used, with its file and face.
    """
    path = Path(os.path.normpath(Path(path).absolute()))
    if not is_robot_file(path):
        raise ModelError(f"{path}: {', '.join(ROBOT_SUFFIXES)} are read, not '{path.suffix}'")
    arguments = checked_arguments(xacro_args)
    if arguments and path.suffix.lower() != ".xacro":
        raise ModelError(f"{path}: xacro_args are for .xacro files")
    if path.suffix.lower() == ".toml":
        return read_capsule_robot(path).description(str(path))
    folders = MeshFolders(path, package_dirs, packages)
    cache = Cache("description")
    key = [_VERSION, str(path), base, sorted((k, str(v)) for k, v in folders.packages.items()),
           arguments, *(str(folder) for folder in folders.package_dirs)]  # fmt: skip
    if (stored := cache.get(key)) is not None and (found := description_from(stored)):
        return found
    try:
        description, files, context = _read(path, folders, base, arguments)
    except ProxError:
        raise
    except (ValueError, RuntimeError, ArithmeticError, np.linalg.LinAlgError) as error:
        raise ModelError(f"{path}: {error}") from None  # of pinocchio, or of numbers out of range
    cache.put(key, description_to(description, [path, *files], context))
    return description


_Read = tuple[RobotDescription, list[Path], dict[str, Any]]


def _read(path: Path, folders: MeshFolders, base: str | None, arguments: dict[str, str]) -> _Read:
    if path.suffix.lower() == ".xacro":
        made = expand(path, folders, arguments)
        root, files, context = made.root, made.files, made.context
        if root.tag not in ("robot", "mujoco"):
            raise ModelError(f"{path}: it makes a <{root.tag}>; expected <mujoco> or <robot>")
        if root.tag == "mujoco":
            raise ModelError(f"{path}: it makes an MJCF; of a xacro, URDF is read")
    else:
        root, files, context = parse_xml(path, {"robot", "mujoco"}), [], {}
    if root.tag == "mujoco":
        return (*_read_mjcf(root, path, folders, base), context)
    description, meshes = _read_urdf(root, path, folders, base)
    return description, [*files, *meshes], context


def _read_urdf(
    root: ET.Element, path: Path, folders: MeshFolders, base: str | None
) -> tuple[RobotDescription, list[Path]]:
    import pinocchio as pin  # here, because a warm cache does without it

    urdf.check_structure(root, path)
    shapes, notes = urdf.shapes(root, folders)
    model = pin.buildModelFromXML(urdf.kinematics_only(root))
    joints, frames = joints_and_frames(model, urdf.speed_limits(root), path)
    first, ends = urdf.ends(root)
    description = assembled(
        shapes,
        joints,
        frames,
        ends=ends,
        name=root.get("name") or path.stem,
        source=path,
        base=base or _default_base(frames, first),
        notes=notes,
    )
    return description, [part.file for parts in shapes.values() for part in parts if part.file]


def _read_mjcf(
    root: ET.Element, path: Path, folders: MeshFolders, base: str | None
) -> tuple[RobotDescription, list[Path]]:
    found = read_mjcf(root, path, folders)
    description = assembled(
        found.shapes,
        found.joints,
        found.frames,
        ends=found.ends,
        name=found.name,
        source=path,
        base=base or _default_base(found.frames, WORLD),
        notes=found.notes,
    )
    return description, found.files


def _default_base(frames: Sequence[Frame], otherwise: str) -> str:
    fixed = any(frame.name == "base_link" and frame.joint < 0 for frame in frames)
    return "base_link" if fixed else otherwise


def description_to(
    description: RobotDescription, files: Iterable[Path], context: Mapping[str, Any] | None = None
) -> Stored:
    """The entry that `description_from` reads; valid while the files stay as they are."""
    joints, links, frames = description.joints, description.links, description.frames
    arrays = {
        "origin": np.array([j.origin for j in joints]),
        "axis": np.array([j.axis for j in joints]),
        "limits": np.array([[getattr(j, name) for name in _LIMITS] for j in joints]),
        "T_JL": np.array([link.T_JL for link in links]),
        "T_JF": np.array([f.T_JF for f in frames]),
    }
    for row, link in enumerate(links):
        arrays[f"v{row}"], arrays[f"f{row}"] = link.vertices_L, link.triangles
    meta = {
        "files": {str(file): hash_file(file) for file in set(files)},
        "name": description.name,
        "tool": description.tool,
        "ends": description.ends,
        "notes": description.notes,
        "context": dict(context or {}),
        "source": description.source,
        "joints": [[j.name, j.type, j.parent] for j in joints],
        "links": [[link.name, link.joint, link.dropped_faces] for link in links],
        "frames": [[f.name, f.joint] for f in frames],
    }
    return Stored(arrays, meta)


def description_from(entry: Stored) -> RobotDescription | None:
    """The description kept in an entry, or None where one of its files has changed."""
    arrays, meta = entry.arrays, entry.meta
    try:
        if any(hash_file(Path(file)) != known for file, known in meta["files"].items()):
            return None
        if not still_holds(meta["context"]):
            return None
        joints = tuple(
            Joint(
                name=name,
                type=kind,
                parent=parent,
                origin=arrays["origin"][i],
                axis=arrays["axis"][i],
                **dict(zip(_LIMITS, arrays["limits"][i].tolist(), strict=True)),
            )
            for i, (name, kind, parent) in enumerate(meta["joints"])
        )
        links = tuple(
            Link(
                name=name,
                joint=joint,
                T_JL=arrays["T_JL"][i],
                vertices_L=arrays[f"v{i}"],
                triangles=arrays[f"f{i}"],
                dropped_faces=dropped,
            )
            for i, (name, joint, dropped) in enumerate(meta["links"])
        )
        frames = tuple(
            Frame(name=name, joint=joint, T_JF=arrays["T_JF"][i])
            for i, (name, joint) in enumerate(meta["frames"])
        )
        return RobotDescription(
            name=meta["name"],
            joints=joints,
            links=links,
            frames=frames,
            tool=meta["tool"],
            ends=tuple(meta["ends"]),
            notes=tuple(meta["notes"]),
            source=meta["source"],
        )
    except (OSError, KeyError, IndexError, TypeError, ValueError):
        return None

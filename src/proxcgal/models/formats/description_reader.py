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
from proxcgal.models.formats import mjcf, urdf
from proxcgal.models.formats.capsule_robot import read_capsule_robot
from proxcgal.models.formats.paths import ROBOT_SUFFIXES, MeshFolders, is_robot_file
from proxcgal.models.formats.pinocchio_model import WORLD, describe
from proxcgal.models.formats.safe_xml import parse_xml

# Bump when what is read from the same files changes.
_VERSION = 1
_LIMITS = ("q_min", "q_max", "qd_max", "qdd_max")


def read_description(
    path: str | os.PathLike[str],
    package_dirs: Sequence[str | os.PathLike[str]] = (),
    base: str | None = None,
    packages: Mapping[str, Path] | None = None,
) -> RobotDescription:
    """Read a robot description with its meshes at full resolution.

    Args:
        path: .urdf, .xacro, .xml (URDF or MJCF, told apart by the outermost tag), or .toml (a list
            of capsules).
        package_dirs: folders that package:// paths and meshes may lie in.
        base: link whose frame is the world. By default `base_link` where no joint moves it, else
            the first link of a URDF, the world of an MJCF.
        packages: folder of some packages, by name.

    Raises:
        ModelError: what cannot be read, with the file and the links or joints concerned.
        GeometryError: a mesh that cannot be used, with its file and face.
    """
    path = Path(os.path.normpath(Path(path).absolute()))
    if not is_robot_file(path):
        raise ModelError(f"{path}: {', '.join(ROBOT_SUFFIXES)} are read, not '{path.suffix}'")
    if path.suffix.lower() == ".toml":
        return read_capsule_robot(path).description(str(path))
    folders = MeshFolders(path, package_dirs, packages)
    cache = Cache("description")
    key = [_VERSION, str(path), base, sorted((k, str(v)) for k, v in folders.packages.items()),
           *(str(folder) for folder in folders.package_dirs)]  # fmt: skip
    if (stored := cache.get(key)) is not None and (found := description_from(stored)):
        return found
    root = parse_xml(path, {"robot", "mujoco"})
    read = _read_mjcf if root.tag == "mujoco" else _read_urdf
    try:
        description, files = read(root, path, folders, base)
    except ProxError:
        raise
    except (ValueError, RuntimeError) as error:  # of pinocchio
        raise ModelError(f"{path}: {error}") from None
    cache.put(key, description_to(description, [path, *files]))
    return description


def _read_urdf(
    root: ET.Element, path: Path, folders: MeshFolders, base: str | None
) -> tuple[RobotDescription, list[Path]]:
    import pinocchio as pin  # here, because a warm cache does without it

    files: list[Path] = []
    if path.suffix.lower() == ".xacro":
        root, files = _expand(path, folders)
    urdf.check_structure(root, path)
    shapes = urdf.shapes(root, folders)
    model = pin.buildModelFromXML(urdf.kinematics_only(root))
    children = {end.get("link") for end in root.findall("joint/child")}
    first = next(e.get("name", "") for e in root.findall("link") if e.get("name") not in children)
    files += [part.file for parts in shapes.values() for part in parts if part.file]
    description = describe(
        model,
        shapes,
        name=root.get("name") or path.stem,
        source=path,
        base=base or _default_base(model, first),
        limits={},
        speeds=urdf.speed_limits(root),
    )
    return description, files


def _read_mjcf(
    root: ET.Element, path: Path, folders: MeshFolders, base: str | None
) -> tuple[RobotDescription, list[Path]]:
    import pinocchio as pin  # here, because a warm cache does without it

    files = mjcf.check_structure(root, path, folders)
    model = pin.buildModelFromMJCF(str(path))
    description = describe(
        model,
        mjcf.shapes(model, path, root),
        name=root.get("model") or path.stem,
        source=path,
        base=base or _default_base(model, WORLD),
        limits=mjcf.position_limits(root, model),
        speeds={},
    )
    return description, files


def _default_base(model: Any, otherwise: str) -> str:
    fixed = any(f.name == "base_link" and f.parentJoint == 0 for f in model.frames)
    return "base_link" if fixed else otherwise


def _expand(path: Path, folders: MeshFolders) -> tuple[ET.Element, list[Path]]:
    """The URDF that a xacro makes, and the files it was made from.

    A xacro is a program: it can read files that it names. Only those that one trusts are for use.
    """
    import xacro  # type: ignore[import-untyped]  # here, for those files only
    from xacrodoc import XacroDoc, packages

    known = {folder.name: folder for folder in folders.package_dirs}
    for folder in folders.package_dirs:
        known |= {inner.name: inner for inner in folder.iterdir() if inner.is_dir()}
    known |= folders.packages
    try:
        packages.update_package_cache({name: str(where) for name, where in known.items()})
        text = XacroDoc.from_file(str(path), resolve_packages=False).to_urdf_string()
        files = [Path(file) for file in xacro.all_includes]
    except Exception as error:  # xacro raises what the expressions in it raise
        raise ModelError(f"{path}: xacro: {error}") from None
    return ET.fromstring(text), files


def description_to(description: RobotDescription, files: Iterable[Path]) -> Stored:
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
            source=meta["source"],
        )
    except (OSError, KeyError, IndexError, TypeError, ValueError):
        return None

"""A description as cache entry, with the files it was read from."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from proxcgal.core.cache import Stored, hash_file
from proxcgal.core.typing import Array
from proxcgal.models.description import Frame, Joint, Link, RobotDescription


def description_to(description: RobotDescription, files: Iterable[Path]) -> Stored:
    """The entry that `description_from` reads; valid while the files stay as they are."""
    joints, links, frames = description.joints, description.links, description.frames
    arrays = {
        "origin": np.array([j.origin for j in joints]),
        "axis": np.array([j.axis for j in joints]),
        "limits": np.array([[j.q_min, j.q_max, j.qd_max, j.qdd_max] for j in joints]),
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
        limits: Array = arrays["limits"]
        joints = tuple(
            Joint(
                name=name,
                type=kind,
                parent=parent,
                origin=arrays["origin"][i],
                axis=arrays["axis"][i],
                q_min=float(limits[i, 0]),
                q_max=float(limits[i, 1]),
                qd_max=float(limits[i, 2]),
                qdd_max=float(limits[i, 3]),
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

"""Mesh files as clean triangles: welded, finite, without empty faces."""

import os
from pathlib import Path

import numpy as np

from proxcgal.core.errors import GeometryError
from proxcgal.core.typing import Array, Ints
from proxcgal.models.formats.safe_xml import FARTHEST
from proxcgal.models.mesh.collada_file import read_dae
from proxcgal.models.mesh.glb_file import read_glb
from proxcgal.models.mesh.obj_file import read_obj
from proxcgal.models.mesh.off_file import read_off
from proxcgal.models.mesh.ply_file import read_ply
from proxcgal.models.mesh.stl_file import read_stl
from proxcgal.models.mesh.triangles import compact, double_areas

MAX_FACES = 5_000_000
MAX_MESH_BYTES = 256 * 2**20  # 5 million faces of a binary STL
MAX_TEXT_BYTES = 32 * 2**20  # text takes ten times its size in memory, and 0.3 s a MiB
_READERS = {".stl": read_stl, ".obj": read_obj, ".ply": read_ply, ".off": read_off,
            ".glb": read_glb}  # fmt: skip
_MAYBE_BINARY = (".stl", ".ply", ".glb")
MESH_SUFFIXES = (".stl", ".obj", ".dae", ".ply", ".off", ".glb")
# Vertices closer than this are one [m].
_WELD = 1e-7
# A face whose doubled area is below this share of its longest side squared has none.
_NO_AREA = 1e-9


def load_mesh(path: str | os.PathLike[str]) -> tuple[Array, Ints]:
    """Triangles of a mesh file, as they are in it.

    Args:
        path: STL, OBJ, DAE (its length unit is applied), PLY, OFF or GLB; at most MAX_FACES faces,
            MAX_MESH_BYTES bytes, MAX_TEXT_BYTES where it is text.

    Returns:
        vertices (v, 3) [m] and triangles (f, 3).

    Raises:
        GeometryError: not such a file, nothing in it, too large, a vertex that is not finite or an
            index of no vertex. Names the file, and the face where one is to blame.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in MESH_SUFFIXES:
        raise GeometryError(f"{path}: not a mesh file; {', '.join(MESH_SUFFIXES)} are read")
    try:
        if (size := path.stat().st_size) > MAX_MESH_BYTES:
            raise GeometryError(f"{path}: {size} bytes; at most {MAX_MESH_BYTES} are read")
        data = path.read_bytes() if suffix != ".dae" else b""
    except OSError as error:
        raise GeometryError(f"{path}: cannot be read: {error.strerror}") from None
    is_text = suffix not in _MAYBE_BINARY or b"\0" not in data
    if suffix != ".dae" and is_text and size > MAX_TEXT_BYTES:
        raise GeometryError(
            f"{path}: {size} bytes of text; at most {MAX_TEXT_BYTES} are read: save it as "
            "binary STL"
        )
    if suffix == ".dae":
        vertices, triangles = read_dae(path, MAX_FACES)
    else:
        vertices, triangles = _READERS[suffix](data, path, MAX_FACES)
    check_mesh(vertices, triangles, str(path))
    return vertices, triangles


def check_mesh(vertices: Array, triangles: Ints, what: str) -> None:
    """Refuse a mesh that no distance can be asked of.

    Raises:
        GeometryError: wrong shape, no face, too many faces, a vertex that is not finite, an index
            of no vertex.
    """
    if vertices.ndim != 2 or vertices.shape[1] != 3 or triangles.ndim != 2:
        raise GeometryError(
            f"{what}: vertices {vertices.shape} and triangles {triangles.shape}; (v, 3) and (f, 3) "
            "are needed"
        )
    if not len(triangles) or triangles.shape[1] != 3:
        raise GeometryError(f"{what}: no triangles")
    if len(triangles) > MAX_FACES:
        raise GeometryError(f"{what}: {len(triangles)} faces; at most {MAX_FACES} are taken")
    if (outside := (triangles < 0) | (triangles >= len(vertices))).any():
        face, corner = np.argwhere(outside)[0]
        raise GeometryError(
            f"{what}: face {face} has vertex {triangles[face, corner]}; there are {len(vertices)}"
        )
    if (bad := ~np.isfinite(vertices).all(axis=1)).any():
        row = int(np.argmax(bad))
        face = np.nonzero((triangles == row).any(axis=1))[0]
        where = f", used by face {face[0]}" if len(face) else ""
        raise GeometryError(f"{what}: vertex {row} is {vertices[row].tolist()}{where}")


def clean_mesh(vertices: Array, triangles: Ints, what: str) -> tuple[Array, Ints, int]:
    """Join vertices that coincide and leave out faces without area.

    Returns:
        vertices (v, 3), triangles (f, 3) and how many faces were left out.

    Raises:
        GeometryError: no face has an area, a vertex is farther than 1e9 m from the origin.
    """
    if not (near := np.abs(vertices).max(axis=1) <= FARTHEST).all():
        row = int(np.argmin(near))
        raise GeometryError(
            f"{what}: vertex {row} is {vertices[row].tolist()}; at most {FARTHEST:g} m from the "
            "origin are taken"
        )
    cell = np.round(vertices / _WELD).astype(np.int64)
    _, first, rows = np.unique(cell, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)  # as in the file
    vertices = vertices[first[order]]
    welded = np.argsort(order)[rows.reshape(-1)][triangles]
    corners = vertices[welded]
    longest = ((corners - np.roll(corners, 1, axis=1)) ** 2).sum(axis=2).max(axis=1)
    good = double_areas(vertices, welded) > _NO_AREA * np.maximum(longest, 1e-300)
    if not good.any():
        raise GeometryError(f"{what}: none of its {len(triangles)} faces has an area")
    vertices, welded = compact(vertices, welded[good])
    return np.ascontiguousarray(vertices, dtype=np.float64), welded, int(np.sum(~good))

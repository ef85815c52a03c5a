"""Mesh files as clean triangles: welded, finite, without empty faces."""

import io
import os
from pathlib import Path

import numpy as np

from proxcgal.core.errors import GeometryError
from proxcgal.core.typing import Array, Ints
from proxcgal.models.formats.safe_xml import FARTHEST, parse_xml
from proxcgal.models.mesh.triangles import compact, double_areas

MAX_FACES = 5_000_000
MAX_MESH_BYTES = 512 * 2**20
MESH_SUFFIXES = (".stl", ".obj", ".dae", ".ply", ".off")
# Vertices closer than this are one [m].
_WELD = 1e-7
# A face whose doubled area is below this share of its longest side squared has none.
_NO_AREA = 1e-9


def load_mesh(path: str | os.PathLike[str]) -> tuple[Array, Ints]:
    """Triangles of a mesh file, as they are in it.

    Args:
        path: STL, OBJ, DAE (its length unit is applied), PLY or OFF.

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
        data = path.read_bytes()
    except OSError as error:
        raise GeometryError(f"{path}: cannot be read: {error.strerror}") from None
    read = _read_obj if suffix == ".obj" else _read_with_trimesh
    vertices, triangles = read(data, path)
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


def _read_obj(data: bytes, path: Path) -> tuple[Array, Ints]:
    """Vertices and faces of an OBJ; what else it holds (materials, normals) is for pictures.

    trimesh takes index 0 for the last vertex and drops what it cannot place, so it is not used.
    """
    vertices: list[list[bytes]] = []
    faces: list[tuple[int, int, int]] = []
    for number, line in enumerate(data.splitlines(), start=1):
        if line.startswith(b"v "):
            vertices.append(line.split()[1:4])
        elif line.startswith(b"f "):
            try:
                corners = [int(token.split(b"/", 1)[0]) for token in line.split()[1:]]
            except ValueError:
                raise GeometryError(f"{path}, line {number}: not a face") from None
            # From 1, or backwards from the latest vertex.
            rows = [c - 1 if c > 0 else len(vertices) + c if c else -1 for c in corners]
            if len(rows) < 3:
                raise GeometryError(
                    f"{path}, line {number}: a face with {len(rows)} corners; 3 are needed"
                )
            if outside := [c for c, row in zip(corners, rows, strict=True)
                           if not 0 <= row < MAX_MESH_BYTES]:  # fmt: skip
                raise GeometryError(
                    f"{path}, line {number}: face {len(faces)} has vertex {outside[0]}; "
                    f"{len(vertices)} are known there"
                )
            faces += [(rows[0], rows[k], rows[k + 1]) for k in range(1, len(rows) - 1)]
            if len(faces) > MAX_FACES:
                raise GeometryError(f"{path}: more than {MAX_FACES} faces")
    try:
        points = np.array(vertices, dtype=np.float64).reshape(-1, 3)
    except ValueError:
        raise GeometryError(f"{path}: a vertex is not three numbers") from None
    return points, np.array(faces, dtype=np.int64).reshape(-1, 3)


def _read_with_trimesh(data: bytes, path: Path) -> tuple[Array, Ints]:
    suffix = path.suffix.lower()
    if suffix == ".stl" and data[:5].lower() != b"solid":
        count = int.from_bytes(data[80:84], "little")
        if count > MAX_FACES:
            raise GeometryError(f"{path}: {count} faces; at most {MAX_FACES} are taken")
        if len(data) < 84 + 50 * count:
            raise GeometryError(f"{path}: cut off: {count} faces take {84 + 50 * count} bytes, "
                                f"{len(data)} are there")  # fmt: skip
    unit = 1.0
    if suffix == ".dae":
        # In metres per unit, which trimesh notes and does not apply. The up axis is left alone, as
        # ROS and pinocchio do.
        try:
            asset = parse_xml(path, {"COLLADA"}).find("asset/unit")
            unit = float(asset.get("meter", "1")) if asset is not None else 1.0
        except ValueError as error:
            raise GeometryError(str(error)) from None
        if not 0 < unit <= FARTHEST:
            raise GeometryError(f"{path}: its unit is {unit} m; more than 0 is needed, at most "
                                f"{FARTHEST:g}")  # fmt: skip
    import trimesh  # here, because a warm cache does without it

    try:
        # From memory: there is no folder from which it could read anything else.
        scene = trimesh.load_scene(io.BytesIO(data), file_type=suffix[1:], process=False)
        mesh = scene.to_mesh()
    except Exception as error:  # whatever a broken file makes the readers raise
        raise GeometryError(f"{path}: cannot be read as a mesh: {error!r}") from None
    vertices = np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3)
    with np.errstate(over="ignore"):  # what overflows is refused as not finite
        return vertices * unit, np.asarray(mesh.faces, dtype=np.int64).reshape(-1, 3)

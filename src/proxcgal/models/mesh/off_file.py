"""OFF files (Geomview), as text."""

from pathlib import Path

import numpy as np

from proxcgal.core.errors import GeometryError
from proxcgal.core.typing import Array, Ints
from proxcgal.models.mesh.polygons import triangulated

# Numbers of one vertex: position, then texture, normal, colour, as the header's letters say.
_HEADERS = {b"OFF": (3,), b"COFF": (6, 7), b"NOFF": (6,), b"STOFF": (5,), b"CNOFF": (9, 10)}


def read_off(data: bytes, path: Path, max_faces: int) -> tuple[Array, Ints]:
    """Vertices and faces of an OFF; colours, normals and texture coordinates are passed over.

    Raises:
        GeometryError: another kind of OFF, too few or too many lines, what is not a number.
    """
    text = data.removeprefix(b"\xef\xbb\xbf")
    lines = [tokens for line in text.splitlines() if (tokens := line.split(b"#", 1)[0].split())]
    head = lines[0][0] if lines else b""
    if head not in _HEADERS or (len(lines[0]) > 1 and lines[0][1] == b"BINARY"):
        found = " ".join(token.decode("latin-1") for token in lines[0][:2]) if lines else ""
        raise GeometryError(
            f"{path}: begins with '{found[:40]}'; {', '.join(h.decode() for h in _HEADERS)} as "
            "text are read"
        )
    lines = ([lines[0][1:]] if len(lines[0]) > 1 else []) + lines[1:]
    try:
        n_vertices, n_faces = (int(token) for token in lines[0][:2])
    except (IndexError, ValueError):
        raise GeometryError(f"{path}: no numbers of vertices and faces in its head") from None
    if not (0 <= n_vertices <= 3 * max_faces and 0 <= n_faces <= max_faces):
        raise GeometryError(
            f"{path}: {n_vertices} vertices, {n_faces} faces; at most {max_faces} faces are taken"
        )
    if len(lines) != 1 + n_vertices + n_faces:
        raise GeometryError(
            f"{path}: {n_vertices} vertices and {n_faces} faces, a line each, are "
            f"{n_vertices + n_faces} lines; {len(lines) - 1} are there"
        )
    allowed = _HEADERS[head] + ((6, 7) if head == b"OFF" else ())  # many write no C
    rows = lines[1 : 1 + n_vertices]
    if rows and ({len(row) for row in rows} - set(allowed)):
        raise GeometryError(
            f"{path}: a vertex of another number of values than {' or '.join(map(str, allowed))}"
        )
    corners: list[int] = []
    counts: list[int] = []
    try:
        points = np.array([row[:3] for row in rows], dtype=np.float64).reshape(-1, 3)
        for row in lines[1 + n_vertices :]:
            count = int(row[0])
            if not 0 <= count < len(row):
                raise GeometryError(f"{path}: face {len(counts)} has fewer corners than it says")
            corners += [int(token) for token in row[1 : 1 + count]]
            counts.append(count)
    except (ValueError, OverflowError) as error:
        if isinstance(error, GeometryError):
            raise
        raise GeometryError(f"{path}: not a number: {error}") from None
    try:
        rows_of = np.array(corners, dtype=np.int64)
    except OverflowError:
        raise GeometryError(f"{path}: a vertex index that is none") from None
    return points, triangulated(points, rows_of, np.array(counts, np.int64), str(path))

"""OFF files (Geomview), as text."""

import io
from array import array
from collections.abc import Iterator
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
    lines = _lines(data.removeprefix(b"\xef\xbb\xbf"))
    first = next(lines, [b""])
    head = first[0]
    if head not in _HEADERS or first[1:2] == [b"BINARY"]:
        found = " ".join(token.decode("latin-1") for token in first[:2])
        raise GeometryError(
            f"{path}: begins with '{found[:40]}'; {', '.join(h.decode() for h in _HEADERS)} as "
            "text are read"
        )
    numbers = first[1:] or next(lines, [])
    try:
        n_vertices, n_faces = (int(token) for token in numbers[:2])
    except ValueError:
        raise GeometryError(f"{path}: no numbers of vertices and faces in its head") from None
    if not (0 <= n_vertices <= 3 * max_faces and 0 <= n_faces <= max_faces):
        raise GeometryError(
            f"{path}: {n_vertices} vertices, {n_faces} faces; at most {max_faces} faces are taken"
        )
    # Many write colours without the C.
    allowed = {*_HEADERS[head], *((6, 7) if head == b"OFF" else ())}
    points, corners, counts = array("d"), array("q"), array("q")
    count = -1
    try:
        for count, row in enumerate(lines):
            if count < n_vertices:
                if len(row) not in allowed or any(b"_" in token for token in row):
                    raise GeometryError(
                        f"{path}: vertex {count} has {len(row)} values; "
                        f"{' or '.join(map(str, sorted(allowed)))} numbers are needed"
                    )
                points.extend(map(float, row[:3]))
                continue
            size = int(row[0])
            if not 0 <= size < len(row):
                raise GeometryError(f"{path}: face {len(counts)} has fewer corners than it says")
            corners.extend(map(int, row[1 : 1 + size]))
            counts.append(size)
    except (ValueError, OverflowError) as error:
        if isinstance(error, GeometryError):
            raise
        raise GeometryError(f"{path}: not a number: {error}") from None
    if count + 1 != n_vertices + n_faces:
        raise GeometryError(
            f"{path}: {n_vertices} vertices and {n_faces} faces, a line each, are "
            f"{n_vertices + n_faces} lines; {count + 1} are there"
        )
    vertices = np.array(points).reshape(-1, 3)
    return vertices, triangulated(vertices, np.array(corners), np.array(counts), str(path))


def _lines(text: bytes) -> Iterator[list[bytes]]:
    """The words of each line that has any, comments left out."""
    for line in io.BytesIO(text):
        if words := line.split(b"#", 1)[0].split():
            yield words

"""Wavefront OBJ files: vertices and faces."""

import io
import re
from array import array
from pathlib import Path

import numpy as np

from proxcgal.core.errors import GeometryError
from proxcgal.core.typing import Array, Ints
from proxcgal.models.mesh.polygons import triangulated

# What says nothing of the surface: names, materials, normals, points and lines.
_PASSED = {b"vt", b"vn", b"vp", b"g", b"o", b"s", b"p", b"l", b"mg", b"usemtl", b"mtllib",
          b"usemap",
           b"maplib", b"bevel", b"c_interp", b"d_interp", b"lod", b"shadow_obj",
           b"trace_obj"}  # fmt: skip
_ROW_LIMIT = 2**31
_CONTINUED = re.compile(rb"(?:[^\n]*\\[ \t]*\r?\n)+[^\n]*")
_END = re.compile(rb"\\[ \t]*\r?\n")


def read_obj(data: bytes, path: Path, max_faces: int) -> tuple[Array, Ints]:
    """Vertices and faces of an OBJ.

    Tabs, leading blanks, a byte-order mark, lines continued by a backslash and comments at the end
    of a line are read. Free-form curves and surfaces are refused.

    Raises:
        GeometryError: names the line.
    """
    data = data.removeprefix(b"\xef\xbb\xbf")
    if b"\n" not in data:  # lines as old Macs end them
        data = data.replace(b"\r", b"\n")
    if b"\\" in data:  # the lines that follow keep their numbers
        data = _CONTINUED.sub(_joined, data)
    vertices, corners, counts = array("d"), array("q"), array("q")
    triangles = 0
    for number, line in enumerate(io.BytesIO(data), start=1):
        if b"#" in line:
            line = line.split(b"#", 1)[0]
        tokens = line.split()
        if not tokens:
            continue
        kind = tokens[0]
        if kind == b"v":
            _check_vertex(tokens, number, path)
            try:
                vertices.extend(map(float, tokens[1:4]))
            except ValueError:
                raise GeometryError(
                    f"{path}, line {number}: a vertex is not three numbers"
                ) from None
        elif kind in (b"f", b"fo"):
            known = len(vertices) // 3
            try:
                given = [int(token.split(b"/", 1)[0]) for token in tokens[1:]]
            except ValueError:
                raise GeometryError(f"{path}, line {number}: not a face") from None
            if len(given) < 3:
                raise GeometryError(
                    f"{path}, line {number}: a face with {len(given)} corners; 3 are needed"
                )
            # From 1, or backwards from the latest vertex.
            rows = [c - 1 if c > 0 else known + c if c else -1 for c in given]
            if min(rows) < 0 or max(rows) >= _ROW_LIMIT:
                outside = next(
                    c for c, row in zip(given, rows, strict=True) if not 0 <= row < _ROW_LIMIT
                )
                raise GeometryError(
                    f"{path}, line {number}: face {len(counts)} has vertex {outside}; "
                    f"{known} are known there"
                )
            corners.extend(rows)
            counts.append(len(rows))
            triangles += len(rows) - 2
            if triangles > max_faces:
                raise GeometryError(f"{path}: more than {max_faces} faces")
        elif kind not in _PASSED:
            raise GeometryError(
                f"{path}, line {number}: '{kind.decode('latin-1')[:40]}' is not read; v and f are, "
                "and what says nothing of the surface is passed over"
            )
    points = np.array(vertices).reshape(-1, 3)
    return points, triangulated(points, np.array(corners), np.array(counts), str(path))


def _joined(lines: re.Match[bytes]) -> bytes:
    """Continued lines as one, with as many line ends as before."""
    return _END.sub(b" ", lines[0]) + b"\n" * lines[0].count(b"\n")


def _check_vertex(tokens: list[bytes], number: int, path: Path) -> None:
    """See that it is x y z, with a weight or a colour after them."""
    count = len(tokens) - 1
    if count not in (3, 4, 6, 7):
        raise GeometryError(
            f"{path}, line {number}: a vertex of {count} numbers; 3 are needed, 4 with a weight, "
            "6 or 7 with a colour"
        )
    if any(b"_" in token for token in tokens[1:4]):
        raise GeometryError(f"{path}, line {number}: a vertex is not three numbers")
    if count == 4 and tokens[4] not in (b"1", b"1.0") and not _is_one(tokens[4]):
        raise GeometryError(f"{path}, line {number}: a vertex with a weight other than 1")


def _is_one(token: bytes) -> bool:
    try:
        return float(token) == 1.0
    except ValueError:
        return False

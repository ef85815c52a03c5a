"""STL files, binary and text."""

import io
from pathlib import Path

import numpy as np

from proxcgal.core.errors import GeometryError
from proxcgal.core.typing import Array, Ints

_HEADER, _FACET = 84, 50
_BINARY = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
# One facet of a text file: words in these places, numbers in the others.
_WORDS = {0: b"facet", 1: b"normal", 5: b"outer", 6: b"loop", 7: b"vertex", 11: b"vertex",
          15: b"vertex", 19: b"endloop", 20: b"endfacet"}  # fmt: skip
_TOKENS = 21
_BLOCK = 2000 * _TOKENS  # so many are converted at once
_LONGEST = 64
_NUMBERS = [8, 9, 10, 12, 13, 14, 16, 17, 18]


def read_stl(data: bytes, path: Path, max_faces: int) -> tuple[Array, Ints]:
    """Corners and faces of an STL, all of its solids.

    Raises:
        GeometryError: cut off, more bytes than its faces take, a facet that is none.
    """
    count = int.from_bytes(data[80:84], "little") if len(data) >= _HEADER else -1
    whole = len(data) == _HEADER + _FACET * count
    text = data.removeprefix(b"\xef\xbb\xbf").lstrip()
    if not whole and text[:5].lower() == b"solid" and b"\0" not in text:
        return _read_text(text, path, max_faces)
    if count < 0:
        raise GeometryError(f"{path}: cut off: an STL has {_HEADER} bytes at least, "
                            f"{len(data)} are there")  # fmt: skip
    if count > max_faces:
        raise GeometryError(f"{path}: {count} faces; at most {max_faces} are taken")
    end = _HEADER + _FACET * count
    if len(data) < end:
        raise GeometryError(
            f"{path}: cut off: {count} faces take {end} bytes, {len(data)} are there"
        )
    if data[end:].strip(b"\0 \r\n\t"):
        raise GeometryError(f"{path}: {len(data) - end} bytes follow its {count} faces")
    corners = np.frombuffer(data, _BINARY, count, _HEADER)["corners"].astype(np.float64)
    return corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def _read_text(text: bytes, path: Path, max_faces: int) -> tuple[Array, Ints]:
    blocks: list[Array] = []
    tokens: list[bytes] = []
    solids = faces = 0
    for line in io.BytesIO(text):
        words = line.split()
        kind = words[0].lower() if words else b""
        if kind == b"solid":
            solids += 1
        elif kind == b"endsolid":
            solids -= 1
        else:
            tokens += words
        if len(tokens) >= _BLOCK:
            whole = len(tokens) - len(tokens) % _TOKENS
            blocks.append(_facets(tokens[:whole], faces, path))
            faces += whole // _TOKENS
            tokens = tokens[whole:]
            if faces > max_faces:
                raise GeometryError(f"{path}: more than {max_faces} faces")
    if solids:
        raise GeometryError(f"{path}: cut off: a solid without endsolid")
    if len(tokens) % _TOKENS:
        raise GeometryError(f"{path}: not a whole number of facets with three vertices each")
    blocks.append(_facets(tokens, faces, path))
    corners = np.concatenate(blocks)
    return corners, np.arange(len(corners)).reshape(-1, 3)


def _facets(tokens: list[bytes], first: int, path: Path) -> Array:
    """Corners (n, 3) of facets, of which the first has that number in the file."""
    if any(len(token) > _LONGEST for token in tokens):
        raise GeometryError(f"{path}: a word of more than {_LONGEST} letters")
    facets = np.array(tokens, dtype=f"S{_LONGEST}").reshape(-1, _TOKENS)
    for place, word in _WORDS.items():
        bad = np.char.lower(facets[:, place]) != word
        if bad.any():
            face = int(np.argmax(bad))
            raise GeometryError(
                f"{path}: facet {first + face} has '{facets[face, place].decode('latin-1')[:40]}' "
                f"where '{word.decode()}' is expected"
            )
    try:
        return facets[:, _NUMBERS].astype(np.float64).reshape(-1, 3)
    except ValueError as error:
        raise GeometryError(f"{path}: a vertex is not three numbers: {error}") from None

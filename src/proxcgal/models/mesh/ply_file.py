"""PLY files, text and binary."""

import io
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np

from proxcgal.core.errors import GeometryError
from proxcgal.core.typing import Array, Ints
from proxcgal.models.mesh.polygons import triangulated

_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",
}  # fmt: skip
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_CORNERS = ("vertex_indices", "vertex_index")
_MOST_HEADER = 64 * 1024


@dataclass
class _Element:
    """One kind of row: its name, how many, and its properties (name, type, type of its count)."""

    name: str
    count: int
    properties: list[tuple[str, str, str | None]] = field(default_factory=list)


def read_ply(data: bytes, path: Path, max_faces: int) -> tuple[Array, Ints]:
    """Vertices and faces of a PLY; every other element and property is passed over.

    Raises:
        GeometryError: a header that is none, an element that is cut off, triangle strips.
    """
    order, elements, body = _header(data, path, max_faces)
    for element in elements:
        if element.name == "tristrips":
            raise GeometryError(f"{path}: element 'tristrips' is not read; faces are")
    points: Array = np.empty((0, 3))
    corners: Ints = np.empty(0, np.int64)
    counts: Ints = np.empty(0, np.int64)
    tokens = (token for line in io.BytesIO(body) for token in line.split())
    at = 0
    for element in elements:
        try:
            if order:
                columns, lists, at = _binary(body, at, element, order)
            else:
                columns, lists = _text(tokens, element)
        except (ValueError, OverflowError) as error:
            raise GeometryError(
                f"{path}: element '{element.name}' is cut off or holds what is no number: {error}"
            ) from None
        if element.name == "vertex":
            if missing := [axis for axis in "xyz" if axis not in columns]:
                raise GeometryError(f"{path}: its vertices have no property '{missing[0]}'")
            points = np.stack([columns[axis] for axis in "xyz"], axis=1).astype(np.float64)
        elif element.name == "face":
            found = next((lists[name] for name in _CORNERS if name in lists), None)
            if found is None:
                raise GeometryError(f"{path}: its faces have no list '{_CORNERS[0]}'")
            corners, counts = found
    rest = body[at:].strip(b"\0 \r\n\t") if order else next(tokens, b"")
    if rest:
        raise GeometryError(f"{path}: more data than its header says")
    return points, triangulated(points, corners, counts, str(path))


def _header(data: bytes, path: Path, max_faces: int) -> tuple[str, list[_Element], bytes]:
    data = data.removeprefix(b"\xef\xbb\xbf")
    end = data.find(b"end_header", 0, _MOST_HEADER)
    line_end = data.find(b"\n", end)
    if data[:3] != b"ply" or end < 0 or line_end < 0:
        raise GeometryError(f"{path}: no header of a PLY file")
    elements: list[_Element] = []
    order = None
    for line in data[:end].decode("latin-1").splitlines()[1:]:
        words = line.split()
        try:
            match words:
                case [] | ["comment", *_] | ["obj_info", *_]:
                    pass
                case ["format", kind, "1.0"]:
                    order = _ORDERS[kind]
                case ["element", name, count]:
                    elements.append(_Element(name, int(count)))
                case ["property", "list", of_count, of_item, name]:
                    elements[-1].properties.append((name, _TYPES[of_item], _TYPES[of_count]))
                case ["property", kind, name]:
                    elements[-1].properties.append((name, _TYPES[kind], None))
                case _:
                    raise ValueError
        except (KeyError, ValueError, IndexError):
            raise GeometryError(f"{path}: header line '{line[:60]}' is not read") from None
    if order is None:
        raise GeometryError(f"{path}: its header names no format")
    for element in elements:
        if not 0 <= element.count <= 3 * max_faces:
            raise GeometryError(f"{path}: {element.count} of '{element.name}'; at most "
                                f"{3 * max_faces} are taken")  # fmt: skip
        if len({name for name, *_ in element.properties}) != len(element.properties):
            raise GeometryError(f"{path}: element '{element.name}' has a property twice")
    return order, elements, data[line_end + 1 :]


_Columns = dict[str, Array]
_Lists = dict[str, tuple[Ints, Ints]]  # items one after another, and how many in each row


def _text(tokens: Iterator[bytes], element: _Element) -> tuple[_Columns, _Lists]:
    if not any(of_count for *_, of_count in element.properties):
        width = len(element.properties)
        values = array("d", map(float, islice(tokens, width * element.count)))
        if len(values) < width * element.count:
            raise ValueError(f"{width * element.count - len(values)} values are missing")
        table = np.array(values).reshape(element.count, width)
        return {p[0]: table[:, k] for k, p in enumerate(element.properties)}, {}
    lists = {
        name: (array("q"), array("q"))
        for name, kind, of_count in element.properties
        if of_count and kind[0] != "f"
    }
    for _ in range(element.count):
        for name, _, of_count in element.properties:
            count = int(next(tokens, b"nothing")) if of_count else 1
            found = list(islice(tokens, max(count, 0)))
            if count < 0 or len(found) < count:
                raise ValueError(f"a list of {count}, of which {len(found)} are there")
            if name in lists:
                lists[name][0].extend(map(int, found))
                lists[name][1].append(count)
    return {}, {k: (np.array(v, np.int64), np.array(n, np.int64)) for k, (v, n) in lists.items()}


def _binary(body: bytes, at: int, element: _Element, order: str) -> tuple[_Columns, _Lists, int]:
    lists = [p for p in element.properties if p[2]]
    if not element.properties:
        return {}, {}, at
    if not lists:
        row = np.dtype([(name, order + kind) for name, kind, _ in element.properties])
        table = _rows(body, at, row, element.count)
        columns = {name: table[name] for name, *_ in element.properties}
        return columns, {}, at + row.itemsize * element.count
    same = _equal_lists(body, at, element, order)
    if same is not None:
        return same
    found: dict[str, tuple[list[Ints], list[int]]] = {name: ([], []) for name, *_ in lists}
    for _ in range(element.count):
        for name, kind, of_count in element.properties:
            item = np.dtype(order + kind)
            count = 1
            if of_count:
                size = np.dtype(order + of_count)
                count = int(_rows(body, at, size, 1)[0])
                at += size.itemsize
                if count < 0:
                    raise ValueError(f"a list of {count}")
                found[name][0].append(_rows(body, at, item, count))
                found[name][1].append(count)
            at += item.itemsize * count
    if at > len(body):
        raise ValueError(f"{at - len(body)} bytes are missing")
    empty = [np.empty(0, np.int64)]
    return {}, {name: (np.concatenate(items or empty).astype(np.int64), np.array(n, np.int64))
                for name, (items, n) in found.items()}, at  # fmt: skip


def _equal_lists(
    body: bytes, at: int, element: _Element, order: str
) -> tuple[_Columns, _Lists, int] | None:
    """All rows at once, where every list is as long as in the first row."""
    fields: list[tuple[str, str] | tuple[str, str, int]] = []
    lengths, place = {}, at
    if not element.count:
        return {}, {p[0]: (np.empty(0, np.int64), np.empty(0, np.int64))
                    for p in element.properties if p[2]}, at  # fmt: skip
    for name, kind, of_count in element.properties:
        item = np.dtype(order + kind)
        if of_count:
            size = np.dtype(order + of_count)
            lengths[name] = int(_rows(body, place, size, 1)[0])
            if not 0 <= lengths[name] <= len(body):
                raise ValueError(f"a list of {lengths[name]}")
            place += size.itemsize + item.itemsize * lengths[name]
            fields += [(f"{name} count", size.str), (name, item.str, lengths[name])]
        else:
            place += item.itemsize
            fields.append((name, item.str))
    row = np.dtype(fields)
    if at + row.itemsize * element.count > len(body):
        return None
    table = _rows(body, at, row, element.count)
    if any((table[f"{name} count"] != n).any() for name, n in lengths.items()):
        return None
    return (
        {},
        {
            name: (table[name].reshape(-1).astype(np.int64), np.full(element.count, n))
            for name, n in lengths.items()
            if table[name].dtype.kind != "f"
        },
        at + row.itemsize * element.count,
    )


def _rows(body: bytes, at: int, kind: np.dtype, count: int) -> np.ndarray:
    """So many items of a kind from a place on; ValueError where the file ends before."""
    if at + kind.itemsize * count > len(body):
        raise ValueError(f"{at + kind.itemsize * count - len(body)} bytes are missing")
    return np.frombuffer(body, kind, count, at)

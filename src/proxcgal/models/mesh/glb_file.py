"""GLB files: glTF 2.0 in one file, its triangles as the scene shows them."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from proxcgal.core.errors import GeometryError
from proxcgal.core.transforms import placed
from proxcgal.core.typing import Array, Ints
from proxcgal.models.mesh.collada_file import strip
from proxcgal.models.mesh.polygons import triangulated

_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_MOST_JSON = 16 * 2**20  # [bytes]
_MOST_PARTS = 10_000
_MOST_NESTED = 64
_APPEARANCE = ("KHR_materials_", "KHR_texture_", "KHR_lights_", "EXT_texture_")


def read_glb(data: bytes, path: Path, max_faces: int) -> tuple[Array, Ints]:
    """Vertices [m] and faces, in the file's own axes.

    Raises:
        GeometryError: another version, compressed or skinned meshes, buffers in other files.
    """
    reader = _Reader(data, path)
    vertices: list[Array] = []
    faces: list[Ints] = []
    total = count = 0
    try:
        for mesh, T in reader.parts():
            for points, triangles in reader.primitives(mesh):
                vertices.append(placed(T, points))
                turned = triangles[:, ::-1] if np.linalg.det(T[:3, :3]) < 0 else triangles
                faces.append(turned + count)
                count += len(points)
                total += len(triangles)
                if total > max_faces:
                    raise GeometryError(f"{path}: more than {max_faces} faces")
                if len(faces) > _MOST_PARTS:
                    raise GeometryError(f"{path}: more than {_MOST_PARTS} parts in its scene")
    except (KeyError, IndexError, TypeError, AttributeError, OverflowError) as error:
        raise GeometryError(f"{path}: not as glTF 2.0 says: {error!r}") from None
    except ValueError as error:
        if isinstance(error, GeometryError):
            raise
        raise GeometryError(f"{path}: not as glTF 2.0 says: {error}") from None
    if not faces:
        raise GeometryError(f"{path}: no triangles in its scene")
    return np.concatenate(vertices), np.concatenate(faces)


class _Reader:
    def __init__(self, data: bytes, path: Path) -> None:
        self._path = path
        if data[:4] != b"glTF" or int.from_bytes(data[4:8], "little") != 2:
            self._refuse("no GLB of version 2")
        chunks: dict[bytes, bytes] = {}
        at, end = 12, int.from_bytes(data[8:12], "little")
        if end != len(data):
            self._refuse(f"cut off: {end} bytes are declared, {len(data)} are there")
        while at + 8 <= end:
            size, kind = int.from_bytes(data[at : at + 4], "little"), data[at + 4 : at + 8]
            if at + 8 + size > end:
                self._refuse("cut off within a chunk")
            chunks.setdefault(kind, data[at + 8 : at + 8 + size])
            at += 8 + size
        if len(chunks.get(b"JSON", b"")) > _MOST_JSON:
            self._refuse(f"more than {_MOST_JSON} bytes of JSON")
        try:
            self._json: dict[str, Any] = json.loads(chunks[b"JSON"])
        except (KeyError, ValueError, RecursionError):
            self._refuse("no JSON in its first chunk")
        if not isinstance(self._json, dict):
            self._refuse("no JSON object in its first chunk")
        self._binary = chunks.get(b"BIN\0", b"")
        for name in self._json.get("extensionsRequired", []):
            if not str(name).startswith(_APPEARANCE):
                self._refuse(f"needs the extension '{name}', which is not read")

    def _refuse(self, what: str) -> NoReturn:
        raise GeometryError(f"{self._path}: {what}")

    def _item(self, kind: str, row: Any) -> dict[str, Any]:
        items = self._json.get(kind, [])
        if not isinstance(row, int) or isinstance(row, bool) or not 0 <= row < len(items):
            self._refuse(f"there is no {kind} {row}")
        found = items[row]
        if not isinstance(found, dict):
            self._refuse(f"{kind} {row} is no object")
        return found

    def parts(self) -> Iterator[tuple[dict[str, Any], Array]]:
        """Each mesh that the scene shows, with T (4, 4) of its frame in the file's."""
        scenes = self._json.get("scenes", [])
        if "scene" not in self._json and len(scenes) != 1:
            self._refuse(f"names no scene, and has {len(scenes)}; one is needed")
        for row in self._item("scenes", self._json.get("scene", 0)).get("nodes", []):
            yield from self._node(row, np.eye(4), 0)

    def _node(self, row: Any, T: Array, depth: int) -> Iterator[tuple[dict[str, Any], Array]]:
        if depth > _MOST_NESTED:
            self._refuse(f"nodes nested deeper than {_MOST_NESTED}")
        node = self._item("nodes", row)
        if "skin" in node:
            self._refuse(f"node {row} has a skin, which is not read")
        if extensions := [e for e in node.get("extensions", {}) if not e.startswith(_APPEARANCE)]:
            self._refuse(f"node {row} has the extension '{extensions[0]}', which is not read")
        T = T @ self._pose(node)
        if "mesh" in node:
            yield self._item("meshes", node["mesh"]), T
        for child in node.get("children", []):
            yield from self._node(child, T, depth + 1)

    def _pose(self, node: dict[str, Any]) -> Array:
        if "matrix" in node:
            T = np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
        else:
            x, y, z, w = np.array(node.get("rotation", [0, 0, 0, 1]), dtype=np.float64)
            norm = x * x + y * y + z * z + w * w
            s = 2 / norm if norm > 0 else np.nan
            R = np.array([
                [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
                [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
                [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
            ])  # fmt: skip
            T = np.eye(4)
            T[:3, :3] = R * np.array(node.get("scale", [1, 1, 1]), dtype=np.float64).reshape(3)
            T[:3, 3] = np.array(node.get("translation", [0, 0, 0]), dtype=np.float64)
        if not np.isfinite(T).all() or (T[3] != [0, 0, 0, 1]).any():
            self._refuse("a node whose transform is none")
        return T

    def primitives(self, mesh: dict[str, Any]) -> Iterator[tuple[Array, Ints]]:
        """Vertices and faces of each primitive that has a surface."""
        for part in mesh["primitives"]:
            if part.get("targets"):
                self._refuse("a mesh with morph targets, which are not read")
            if extensions := [e for e in part.get("extensions", {})
                              if not e.startswith(_APPEARANCE)]:  # fmt: skip
                self._refuse(f"a mesh with the extension '{extensions[0]}', which is not read")
            mode = part.get("mode", _TRIANGLES)
            if mode not in (_TRIANGLES, _STRIP, _FAN):
                continue  # points and lines
            points = self._accessor(part["attributes"]["POSITION"]).astype(np.float64)
            if points.shape[1] != 3:
                self._refuse("positions of other than 3 numbers")
            rows = self._rows(part["indices"]) if "indices" in part else np.arange(len(points))
            if mode != _TRIANGLES:
                rows = strip(rows, mode == _FAN).reshape(-1)
            if len(rows) % 3:
                self._refuse(f"{len(rows)} corners; 3 a face are needed")
            yield points, triangulated(points, rows, np.full(len(rows) // 3, 3), str(self._path))

    def _rows(self, accessor: Any) -> Ints:
        found = self._accessor(accessor)
        if found.dtype.kind != "u":
            self._refuse(f"accessor {accessor} of indices holds other than unsigned integers")
        rows: Ints = found.astype(np.int64).reshape(-1)
        return rows

    def _accessor(self, row: Any) -> Any:
        found = self._item("accessors", row)
        if "sparse" in found or "bufferView" not in found:
            self._refuse(f"accessor {row} is sparse, which is not read")
        view = self._item("bufferViews", found["bufferView"])
        if view.get("buffer", 0) != 0 or "uri" in self._item("buffers", 0):
            self._refuse("its data lies in another file, which is not read")
        kind, width = np.dtype(_TYPES[found["componentType"]]), _WIDTHS[found["type"]]
        if found.get("normalized"):
            self._refuse(f"accessor {row} is normalized, which is not read")
        size = kind.itemsize * width
        count, stride = int(found["count"]), int(view.get("byteStride", size))
        within, first = int(found.get("byteOffset", 0)), int(view.get("byteOffset", 0))
        length = int(view["byteLength"])
        if (min(count, within, first, length) < 0 or stride < size
                or first + length > len(self._binary)
                or (count and within + (count - 1) * stride + size > length)):  # fmt: skip
            self._refuse(f"accessor {row} reaches past its data")
        if not count:
            return np.empty((0, width), kind)
        return np.ndarray((count, width), kind, self._binary, first + within,
                          (stride, kind.itemsize)).copy()  # fmt: skip

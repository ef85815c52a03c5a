"""COLLADA (DAE) files: the triangles of every geometry that the scene shows."""

from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn
from xml.etree import ElementTree as ET

import numpy as np

from proxcgal.core.errors import GeometryError
from proxcgal.core.transforms import placed
from proxcgal.core.typing import Array, Ints
from proxcgal.models.formats.safe_xml import FARTHEST, parse_xml
from proxcgal.models.mesh.polygons import cut_by_ears, triangulated

_MOST_PARTS = 10_000  # geometries in the scene, each instance counted
_MOST_NESTED = 64  # nodes that show nodes
# What a node may hold beside transforms, nodes and geometries, and says nothing of a surface.
_PASSED = {"asset", "extra", "instance_camera", "instance_light"}
_NO_SURFACE = {"lines", "linestrips", "extra", "source", "vertices"}


def read_dae(path: Path, max_faces: int) -> tuple[Array, Ints]:
    """Vertices [m], by the file's unit, and faces. The up axis is left alone, as ROS does.

    Raises:
        GeometryError: no scene, skins, splines, morphs, what refers to another file or to nothing.
    """
    try:
        root = parse_xml(path, {"COLLADA"}, bare_names=True)
    except ValueError as error:
        raise GeometryError(str(error)) from None
    return _Reader(root, path, max_faces).read()


class _Reader:
    def __init__(self, root: ET.Element, path: Path, max_faces: int) -> None:
        self._root, self._path, self._max_faces = root, path, max_faces
        self._by_id = {e.get("id"): e for e in root.iter() if e.get("id")}
        self._known: dict[str, tuple[Array, Ints]] = {}

    def read(self) -> tuple[Array, Ints]:
        vertices: list[Array] = []
        faces: list[Ints] = []
        total = count = 0
        for geometry, T in self._scene():
            points, triangles = self._geometry(geometry)
            vertices.append(placed(T, points))
            turned = triangles[:, ::-1] if np.linalg.det(T[:3, :3]) < 0 else triangles
            faces.append(turned + count)
            count += len(points)
            total += len(triangles)
            if total > self._max_faces:
                raise GeometryError(f"{self._path}: more than {self._max_faces} faces")
            if len(faces) > _MOST_PARTS:
                raise GeometryError(
                    f"{self._path}: more than {_MOST_PARTS} geometries in its scene"
                )
        if not faces:
            raise GeometryError(f"{self._path}: no triangles in its scene")
        return np.concatenate(vertices) * self._unit(), np.concatenate(faces)

    def _refuse(self, what: str) -> NoReturn:
        raise GeometryError(f"{self._path}: {what}")

    def _unit(self) -> float:
        """Metres per unit."""
        asset = self._root.find("asset/unit")
        text = "1" if asset is None else asset.get("meter", "1")
        try:
            unit = float(text)
        except ValueError:
            self._refuse(f"its unit is '{text[:40]}' m; a number is needed")
        if not 0 < unit <= FARTHEST:
            self._refuse(f"its unit is {unit} m; more than 0 is needed, at most {FARTHEST:g}")
        return unit

    def _target(self, url: str | None, tag: str) -> ET.Element:
        if not url or not url.startswith("#"):
            self._refuse(
                f"<{tag}> at '{(url or '')[:60]}'; only what is in the file itself is read"
            )
        found = self._by_id.get(url[1:])
        if found is None or found.tag != tag:
            self._refuse(f"there is no <{tag}> of id '{url[1:61]}'")
        return found

    def _scene(self) -> Iterator[tuple[ET.Element, Array]]:
        """Each geometry that is shown, with T (4, 4) of its frame in the file's."""
        shown = self._root.find("scene/instance_visual_scene")
        scenes = self._root.findall("library_visual_scenes/visual_scene")
        if shown is not None:
            scene = self._target(shown.get("url"), "visual_scene")
        elif len(scenes) == 1:
            scene = scenes[0]
        else:
            self._refuse(f"names no scene, and has {len(scenes)}; one is needed")
        for node in scene.findall("node"):
            yield from self._node(node, np.eye(4), 0)

    def _node(self, node: ET.Element, T: Array, depth: int) -> Iterator[tuple[ET.Element, Array]]:
        if depth > _MOST_NESTED:
            self._refuse(f"nodes nested deeper than {_MOST_NESTED}")
        for child in node:
            if child.tag in _TRANSFORMS:
                T = T @ self._transform(child)
        for child in node:
            if child.tag == "node":
                yield from self._node(child, T, depth + 1)
            elif child.tag == "instance_node":
                yield from self._node(self._target(child.get("url"), "node"), T, depth + 1)
            elif child.tag == "instance_geometry":
                yield self._target(child.get("url"), "geometry"), T
            elif child.tag not in _TRANSFORMS and child.tag not in _PASSED:
                self._refuse(f"<{child.tag}> in node '{node.get('id', '')}' is not read")

    def _transform(self, element: ET.Element) -> Array:
        values = self._floats(element, _TRANSFORMS[element.tag])
        T = np.eye(4)
        if element.tag == "matrix":
            T = values.reshape(4, 4)
            if (T[3] != [0, 0, 0, 1]).any():
                self._refuse("a <matrix> whose last row is not 0 0 0 1")
        elif element.tag == "translate":
            T[:3, 3] = values
        elif element.tag == "scale":
            T[:3, :3] = np.diag(values)
        else:  # Rodrigues' formula
            length = np.linalg.norm(values[:3])
            if length > 0:
                x, y, z = values[:3] / length
                K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
                angle = np.radians(values[3])
                T[:3, :3] += np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
        return T

    def _floats(self, element: ET.Element, count: int | None = None) -> Array:
        try:
            values = np.fromstring((element.text or "").strip(), dtype=np.float64, sep=" ")
        except ValueError as error:
            self._refuse(f"<{element.tag}>: {error}")
        if count is not None and (len(values) != count or not np.isfinite(values).all()):
            self._refuse(
                f"<{element.tag}> holds {len(values)} numbers; {count} finite ones are needed"
            )
        return values

    def _ints(self, element: ET.Element | None) -> Ints:
        try:
            text = "" if element is None else element.text or ""
            return np.fromstring(text.strip(), dtype=np.int64, sep=" ")
        except (ValueError, OverflowError) as error:
            self._refuse(f"an index that is none: {error}")

    def _geometry(self, geometry: ET.Element) -> tuple[Array, Ints]:
        key = geometry.get("id", "")
        if key not in self._known:
            mesh = geometry.find("mesh")
            if mesh is None:
                self._refuse(f"geometry '{key}' is no <mesh>; splines and others are not read")
            self._known[key] = self._mesh(mesh, f"{self._path}: geometry '{key}'")
        return self._known[key]

    def _mesh(self, mesh: ET.Element, what: str) -> tuple[Array, Ints]:
        vertices: list[Array] = []
        faces: list[Ints] = []
        sources: dict[str, int] = {}  # where the vertices of a source begin
        total = 0
        for part in mesh:
            if part.tag in _NO_SURFACE:
                continue
            if part.tag not in _PRIMITIVES:
                self._refuse(f"<{part.tag}> is not read; {', '.join(_PRIMITIVES)} are")
            source, offset, stride = self._input(part)
            if source not in sources:
                sources[source] = total
                vertices.append(self._source(source))
                total += len(vertices[-1])
            points = vertices[list(sources).index(source)]
            if (found := self._faces(part, points, offset, stride, what)) is not None:
                faces.append(found + sources[source])
        if not faces:
            return np.empty((0, 3)), np.empty((0, 3), np.int64)
        return np.concatenate(vertices), np.concatenate(faces)

    def _input(self, part: ET.Element) -> tuple[str, int, int]:
        """Id of the positions' source, and which of how many indices of a corner is theirs."""
        inputs = part.findall("input")
        try:
            offsets = [int(e.get("offset", "")) for e in inputs]
        except ValueError:
            self._refuse(f"an <input> of <{part.tag}> without an offset")
        if any(not 0 <= offset < 64 for offset in offsets):
            self._refuse(f"an <input> of <{part.tag}> with offset {max(offsets)}")
        for element, offset in zip(inputs, offsets, strict=True):
            if element.get("semantic") == "VERTEX":
                shared = self._target(element.get("source"), "vertices")
                for position in shared.findall("input"):
                    if position.get("semantic") == "POSITION":
                        return position.get("source", ""), offset, max(offsets) + 1
        self._refuse(f"<{part.tag}> without positions of its vertices")

    def _source(self, url: str) -> Array:
        source = self._target(url, "source")
        accessor = source.find("technique_common/accessor")
        if accessor is None:
            self._refuse(f"source '{url[1:]}' has no accessor")
        values = self._floats(self._target(accessor.get("source"), "float_array"))
        names = [p.get("name", "") for p in accessor.findall("param")]
        columns = [names.index(axis) for axis in "XYZ"] if {*"XYZ"} <= set(names) else [0, 1, 2]
        try:
            count, stride, first = (int(accessor.get(key, default)) for key, default in
                                    (("count", ""), ("stride", "1"), ("offset", "0")))  # fmt: skip
        except ValueError:
            self._refuse(f"accessor of source '{url[1:]}' without a count")
        if not (first >= 0 and max(columns) < stride and 0 <= count <= len(values)
                and first + count * stride <= len(values)):  # fmt: skip
            self._refuse(
                f"source '{url[1:]}' wants {count} positions, {stride} numbers each; "
                f"{len(values)} numbers are there"
            )
        return values[first : first + count * stride].reshape(count, stride)[:, columns]

    def _faces(
        self, part: ET.Element, points: Array, offset: int, stride: int, what: str
    ) -> Ints | None:
        def corners(element: ET.Element | None) -> Ints:
            rows = self._ints(element)
            if len(rows) % stride:
                self._refuse(f"<{part.tag}>: {len(rows)} indices; {stride} a corner are needed")
            return rows.reshape(-1, stride)[:, offset]

        lists = [corners(element) for element in part.findall("p")]
        if part.tag == "polygons":
            return self._polygons(part, points, lists, corners, what)
        if part.tag in ("tristrips", "trifans"):
            found = [strip(rows, part.tag == "trifans") for rows in lists]
            rows = np.concatenate(found) if found else np.empty((0, 3), np.int64)
            return triangulated(points, rows.reshape(-1), np.full(len(rows), 3), what)
        rows = lists[0] if lists else np.empty(0, np.int64)
        if len(lists) > 1:
            self._refuse(f"<{part.tag}> with {len(lists)} <p>; one is read")
        counts = self._ints(part.find("vcount"))
        if part.tag == "triangles":
            if len(rows) % 3:
                self._refuse(f"<triangles>: {len(rows)} corners; 3 a face are needed")
            counts = np.full(len(rows) // 3, 3)
        if (counts < 0).any() or counts.sum() != len(rows):
            self._refuse(f"<{part.tag}>: {len(rows)} corners; its faces take {counts.sum()}")
        return triangulated(points, rows, counts, what)

    def _polygons(self, part, points, lists, corners, what) -> Ints:  # type: ignore[no-untyped-def]
        found = [triangulated(points, rows, np.array([len(rows)]), what) for rows in lists]
        for holed in part.findall("ph"):
            rings = [corners(holed.find("p")), *(corners(hole) for hole in holed.findall("h"))]
            for ring in rings:
                triangulated(points, ring, np.array([len(ring)]), what)
            found.append(cut_by_ears(points, rings, what))
        return np.concatenate(found) if found else np.empty((0, 3), np.int64)


def strip(rows: Ints, fan: bool) -> Ints:
    """Triangles (f, 3) of a strip, or of a fan, of corners (n,), all in one sense."""
    n = max(len(rows) - 2, 0)
    at = np.arange(n)
    if fan:
        return rows[np.stack([np.zeros(n, np.int64), at + 1, at + 2], axis=1)]
    odd = at % 2
    return rows[np.stack([at, at + 1 + odd, at + 2 - odd], axis=1)]


_TRANSFORMS = {"matrix": 16, "translate": 3, "rotate": 4, "scale": 3}
_PRIMITIVES = ("triangles", "polylist", "polygons", "tristrips", "trifans")

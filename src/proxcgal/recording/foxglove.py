"""Foxglove's well-known messages, in JSON: what its 3D panel shows without any set-up.

Only the parts of the schemas that are used, under their published names and fields.
"""

import base64
import json
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from proxcgal.core.transforms import axes_along, quaternion
from proxcgal.core.typing import Array
from proxcgal.scene.solids import Box, Cylinder, Solid, Sphere
from proxcgal.sim.clouds import Points

Schema = dict[str, Any]

WORLD = "world"
_FLOAT32 = 7  # of foxglove.NumericType
_NANO = 1_000_000_000


def _object(title: str, **properties: Schema) -> Schema:
    return {"type": "object", "title": title, "properties": properties}


def _numbers(title: str, names: str) -> Schema:
    return _object(title, **{name: {"type": "number"} for name in names})


def _list(of: Schema) -> Schema:
    return {"type": "array", "items": of}


_TEXT, _WHOLE, _NUMBER = {"type": "string"}, {"type": "integer"}, {"type": "number"}
_BYTES = {"type": "string", "contentEncoding": "base64"}
_TIME = _object("time", sec=_WHOLE, nsec=_WHOLE)
_DURATION = _object("duration", sec=_WHOLE, nsec=_WHOLE)
_VECTOR = _numbers("foxglove.Vector3", "xyz")
_QUATERNION = _numbers("foxglove.Quaternion", "xyzw")
_COLOR = _numbers("foxglove.Color", "rgba")
_POSE = _object("foxglove.Pose", position=_VECTOR, orientation=_QUATERNION)
_FIELD = _object("foxglove.PackedElementField", name=_TEXT, offset=_WHOLE, type=_WHOLE)
_TRANSFORM = _object(
    "foxglove.FrameTransform", timestamp=_TIME, parent_frame_id=_TEXT, child_frame_id=_TEXT,
    translation=_VECTOR, rotation=_QUATERNION,
)  # fmt: skip
_ARROW = _object(
    "foxglove.ArrowPrimitive", pose=_POSE, shaft_length=_NUMBER, shaft_diameter=_NUMBER,
    head_length=_NUMBER, head_diameter=_NUMBER, color=_COLOR,
)  # fmt: skip
_CUBE = _object("foxglove.CubePrimitive", pose=_POSE, size=_VECTOR, color=_COLOR)
_SPHERE = _object("foxglove.SpherePrimitive", pose=_POSE, size=_VECTOR, color=_COLOR)
_CYLINDER = _object(
    "foxglove.CylinderPrimitive", pose=_POSE, size=_VECTOR, bottom_scale=_NUMBER,
    top_scale=_NUMBER, color=_COLOR,
)  # fmt: skip
_OTHER_PRIMITIVES = ("lines", "triangles", "texts", "models")
_ENTITY = _object(
    "foxglove.SceneEntity", timestamp=_TIME, frame_id=_TEXT, id=_TEXT, lifetime=_DURATION,
    frame_locked={"type": "boolean"}, metadata=_list({"type": "object"}), arrows=_list(_ARROW),
    cubes=_list(_CUBE), spheres=_list(_SPHERE), cylinders=_list(_CYLINDER),
    **{name: _list({"type": "object"}) for name in _OTHER_PRIMITIVES},
)  # fmt: skip
_PRIMITIVES = ("arrows", "cubes", "spheres", "cylinders", *_OTHER_PRIMITIVES)
_DELETION = _object("foxglove.SceneEntityDeletion", timestamp=_TIME, type=_WHOLE, id=_TEXT)

_POINT_CLOUD = _object(
    "foxglove.PointCloud", timestamp=_TIME, frame_id=_TEXT, pose=_POSE, point_stride=_WHOLE,
    fields=_list(_FIELD), data=_BYTES,
)  # fmt: skip

#: Schema of each topic beside the ticks.
TOPICS: dict[str, Schema] = {
    "/cloud": _POINT_CLOUD,
    "/links": _object("foxglove.FrameTransforms", transforms=_list(_TRANSFORM)),
    "/scene": _object(
        "foxglove.SceneUpdate", deletions=_list(_DELETION), entities=_list(_ENTITY)
    ),
    "/removed": _POINT_CLOUD,
}  # fmt: skip


def nanoseconds(time: float) -> int:
    """[ns] of a time in seconds, as MCAP counts: from 0 on, and no fault in it stops a log."""
    return min(max(round(time * _NANO), 0), 2**64 - 1) if math.isfinite(time) else 0


def point_cloud(time: float, points_W: Points) -> bytes:
    """foxglove.PointCloud of (n, 3) points [m]."""
    data = np.ascontiguousarray(points_W, "<f4").tobytes()
    fields = [{"name": n, "offset": 4 * i, "type": _FLOAT32} for i, n in enumerate("xyz")]
    return _json(
        timestamp=_time(time), frame_id=WORLD, pose=_pose(np.eye(4)), point_stride=12,
        fields=fields, data=base64.b64encode(data).decode(),
    )  # fmt: skip


def points_of(message: bytes) -> Points:
    """(n, 3) the points of a `point_cloud` [m]."""
    return np.frombuffer(base64.b64decode(json.loads(message)["data"]), "<f4").reshape(-1, 3)


def frame_transforms(time: float, names: Sequence[str], poses_W: Array) -> bytes:
    """foxglove.FrameTransforms of (n, 4, 4) poses."""
    stamp = _time(time)
    transforms = [
        {
            "timestamp": stamp,
            "parent_frame_id": WORLD,
            "child_frame_id": name,
            "translation": _vector(T_W[:3, 3]),
            "rotation": _quaternion(T_W[:3, :3]),
        }
        for name, T_W in zip(names, poses_W, strict=True)
    ]
    return _json(transforms=transforms)


def arrow_update(
    time: float, tail_W: Sequence[float] | None, tip_W: Sequence[float] | None
) -> bytes:
    """foxglove.SceneUpdate: the closest pair as an arrow; without one, the last arrow goes."""
    if tail_W is None or tip_W is None:
        gone = {"timestamp": _time(time), "type": 0, "id": "closest_pair"}
        return _json(deletions=[gone], entities=[])
    tail, along = np.array(tail_W), np.array(tip_W) - np.array(tail_W)
    length = float(np.linalg.norm(along))
    head = min(0.03, 0.4 * length)
    R = axes_along(along, (1.0, 0.0, 0.0)).T  # an arrow of Foxglove lies along x
    arrow = {
        "pose": {"position": _vector(tail), "orientation": _quaternion(R)},
        "shaft_length": length - head, "shaft_diameter": 0.012, "head_length": head,
        "head_diameter": 0.03, "color": dict(zip("rgba", (0.85, 0.1, 0.1, 1.0), strict=True)),
    }  # fmt: skip
    return _json(deletions=[], entities=[_entity(time, "closest_pair", arrows=[arrow])])


def solids(time: float, named: Sequence[tuple[str, Solid, Array]]) -> bytes:
    """foxglove.SceneUpdate of solids: name, shape, pose (4, 4)."""
    entities = [_entity(time, name, **_primitives(solid, T)) for name, solid, T in named]
    return _json(deletions=[], entities=entities)


def _primitives(solid: Solid, T_WO: Array) -> dict[str, Any]:
    """What Foxglove has for a shape: a capsule is a cylinder and two spheres."""

    def at(height: float, *size: float) -> dict[str, Any]:
        T = T_WO.copy()
        T[:3, 3] += height * T[:3, 2]
        color = dict(zip("rgba", (0.93, 0.68, 0.38, 0.6), strict=True))
        return {"pose": _pose(T), "size": _vector(size), "color": color}

    if isinstance(solid, Box):
        return {"cubes": [at(0.0, *solid.size)]}
    width = 2.0 * solid.radius
    if isinstance(solid, Sphere):
        return {"spheres": [at(0.0, width, width, width)]}
    height = solid.height if isinstance(solid, Cylinder) else solid.length
    tube = at(0.0, width, width, height) | {"bottom_scale": 1.0, "top_scale": 1.0}
    if isinstance(solid, Cylinder):
        return {"cylinders": [tube]}
    ends = [at(0.5 * side * height, width, width, width) for side in (-1.0, 1.0)]
    return {"cylinders": [tube], "spheres": ends}


def _entity(time: float, name: str, **primitives: Any) -> dict[str, Any]:
    empty: dict[str, list[Any]] = {kind: [] for kind in _PRIMITIVES}
    return {
        "timestamp": _time(time), "frame_id": WORLD, "id": name, "frame_locked": False,
        "lifetime": {"sec": 0, "nsec": 0}, "metadata": [], **empty, **primitives,
    }  # fmt: skip


def _json(**content: Any) -> bytes:
    return json.dumps(content, separators=(",", ":")).encode()


def _time(time: float) -> dict[str, int]:
    sec, nsec = divmod(nanoseconds(time), _NANO)
    return {"sec": sec, "nsec": nsec}


def _vector(values: Sequence[float] | Array) -> dict[str, float]:
    return {name: float(value) for name, value in zip("xyz", values, strict=True)}


def _pose(T: Array) -> dict[str, dict[str, float]]:
    return {"position": _vector(T[:3, 3]), "orientation": _quaternion(T[:3, :3])}


def _quaternion(R: Array) -> dict[str, float]:
    return {name: float(value) for name, value in zip("xyzw", quaternion(R), strict=True)}

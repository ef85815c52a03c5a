"""From MuJoCo's compiled model to joints, frames and shapes."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from proxcgal.core.errors import ModelError
from proxcgal.core.transforms import inverse
from proxcgal.core.typing import Array
from proxcgal.models.description import Frame, Joint, listed
from proxcgal.models.formats.child import run_limited
from proxcgal.models.formats.parts import WORLD, Kind, Shape, motion
from proxcgal.models.formats.paths import MeshFolders
from proxcgal.models.mesh.shapes import box, capsule, cylinder, ellipsoid
from proxcgal.models.mjcf.files import ModelFiles

_COMPILER = Path(__file__).with_name("compiler.py")
# MuJoCo's numbers for the kinds of joints, geoms and what a tendon is wrapped round (mjmodel.h).
_FREE, _BALL, _SLIDE = 0, 1, 2
_PLANE, _SPHERE, _CAPSULE, _ELLIPSOID, _CYLINDER, _BOX, _MESH = 0, 2, 3, 4, 5, 6, 7
_WRAP_JOINT = 1
# Geoms in groups from here on are not drawn unless asked for: by custom they are for contacts.
_HIDDEN_GROUP = 3


@dataclass
class MjcfRobot:
    """What an MJCF says of a robot, in the frame of its world."""

    name: str
    joints: list[Joint]
    frames: list[Frame]
    shapes: dict[str, list[Shape]]
    ends: list[str]  # the frames of bodies that carry no other
    files: list[Path]
    notes: list[str] = field(default_factory=list)


def read_mjcf(root: ET.Element, path: Path, folders: MeshFolders) -> MjcfRobot:
    """Read an MJCF through MuJoCo.

    Raises:
        ModelError: names what is not read, with the body, joint or geom concerned.
    """
    files = ModelFiles(root, path, folders)
    reply, arrays = run_limited(_COMPILER, {"path": str(path), "meshes": None}, path)
    paths = _mesh_paths(reply, root, files)
    if "needs" in reply:
        real = {name: str(paths[name]) for name in reply["needs"]}
        reply, arrays = run_limited(_COMPILER, {"path": str(path), "meshes": real}, path)
    for name, array in arrays.items():
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            raise ModelError(f"{path}: {name} holds what is no finite number")
    return _Reader(path, reply, arrays, paths).read([*files.files, *paths.values()], root)


def _mesh_paths(reply: dict[str, Any], root: ET.Element, files: ModelFiles) -> dict[str, Path]:
    found = {}
    for name, told in reply["meshes"].items():
        users = [
            body.get("name", "?")
            for body in root.iter("body")
            if any(geom.get("mesh") == name for geom in body.findall("geom"))
        ]
        what = f"mesh '{name}'" + (f" of link {listed(users)}" if users else "")
        found[name] = files.mesh(told["file"], told["folder"], what)
    return found


class _Reader:
    def __init__(
        self, path: Path, reply: dict[str, Any], arrays: dict[str, Any], paths: dict[str, Path]
    ) -> None:
        self._path, self._reply, self._m, self._paths = path, reply, arrays, paths
        self._parent = arrays["body_parentid"]
        self._left_out = self._props()
        self._bodies = _unique(reply["bodies"], "body")
        self._joints = _unique(reply["joints"], "joint")

    def read(self, files: list[Path], root: ET.Element) -> MjcfRobot:
        self._check_joints()
        self._check_tendons()
        self._check_top()
        joints, place = self._chain()
        frames = []
        for body in range(1, len(self._parent)):
            if body not in self._left_out:
                frames.append(Frame(name=self._bodies[body], joint=place[body][0],
                                    T_JF=place[body][1]))  # fmt: skip
        known = {frame.name for frame in frames}
        sites: dict[int, list[str]] = {}
        for site, name in enumerate(self._reply["sites"]):
            body = int(self._m["site_bodyid"][site])
            if not name or name in known or body in self._left_out:
                continue
            known.add(name)
            sites.setdefault(body, []).append(name)
            T = place[body][1] @ self._pose("site", site)
            frames.append(Frame(name=name, joint=place[body][0], T_JF=T))
        notes = []
        if gone := [self._bodies[b] for b in self._left_out if self._parent[b] == 0]:
            notes.append(f"body {listed(gone)}: moved by hand (mocap), or empty; left out")
        return MjcfRobot(
            name=root.get("model") or self._path.stem,
            joints=joints,
            frames=frames,
            shapes=self._shapes(),
            ends=self._ends(sites),
            files=files,
            notes=notes,
        )

    def _ends(self, sites: dict[int, list[str]]) -> list[str]:
        """Bodies that carry no other; where such a body has one site, that."""
        carrying = set(self._parent[1:].tolist())
        ends = [b for b in range(1, len(self._parent)) if b not in carrying | self._left_out]
        return [sites[b][0] if len(sites.get(b, ())) == 1 else self._bodies[b] for b in ends]

    def _props(self) -> set[int]:
        """Bodies at the top that are no part of a robot, with what they carry.

        An arm may stand on a body that is moved by hand (mocap); without joints that is a mark.
        """
        m, n = self._m, len(self._parent)
        top = np.arange(n)
        for body in range(1, n):
            if self._parent[body]:
                top[body] = top[self._parent[body]]
        moving = {int(top[b]) for b in m["jnt_bodyid"]}
        shown = moving | {int(top[b]) for b in m["geom_bodyid"]}
        by_hand = {b for b in range(1, n) if m["body_mocapid"][b] >= 0} - moving
        return {b for b in range(1, n) if int(top[b]) in by_hand or int(top[b]) not in shown}

    def _check_joints(self) -> None:
        for joint, kind in enumerate(self._m["jnt_type"]):
            if kind in (_FREE, _BALL):
                raise ModelError(
                    f"{self._path}: joint '{self._reply['joints'][joint] or '?'}' of body "
                    f"'{self._bodies[self._m['jnt_bodyid'][joint]]}' is "
                    f"{'free' if kind == _FREE else 'ball'}; hinge and slide joints are read"
                )

    def _check_tendons(self) -> None:
        m = self._m
        for tendon, first in enumerate(m["tendon_adr"]):
            rows = slice(first, first + m["tendon_num"][tendon])
            on_joints = m["wrap_type"][rows] == _WRAP_JOINT
            joints = [self._joints[j] for j in dict.fromkeys(m["wrap_objid"][rows][on_joints])]
            if on_joints.all() and len(joints) < 2 and not m["tendon_limited"][tendon]:
                continue
            name = self._reply["tendons"][tendon] or "?"
            over = f" over joints {listed(joints)}" if joints else ""
            raise ModelError(
                f"{self._path}: tendon '{name}'{over} makes joints depend on others, or limits "
                "them; such joints are not read: take a model without it"
            )

    def _check_top(self) -> None:
        top = [b for b in range(1, len(self._parent))
               if self._parent[b] == 0 and b not in self._left_out]  # fmt: skip
        if len(top) > 1:
            raise ModelError(
                f"{self._path}: bodies {listed(self._bodies[b] for b in top)} stand side by side "
                "in the world; one is read, the base"
            )

    def _pose(self, kind: str, row: int) -> Array:
        return pose_of(self._m[f"{kind}_pos"][row], self._m[f"{kind}_quat"][row])

    def _chain(self) -> tuple[list[Joint], list[tuple[int, Array]]]:
        """Joints, and where each body is: the joint that moves it, and its pose in that joint.

        MuJoCo's own order (mj_kinematics): a body's joints act one after another, each about its
        place and axis in the body, from the reference value on.
        """
        m = self._m
        joints: list[Joint] = []
        place: list[tuple[int, Array]] = [(-1, np.eye(4))]
        for body in range(1, len(self._parent)):
            row, T = place[self._parent[body]]
            T = T @ self._pose("body", body)
            for j in np.flatnonzero(m["jnt_bodyid"] == body):
                kind: Kind = "prismatic" if m["jnt_type"][j] == _SLIDE else "revolute"
                axis = m["jnt_axis"][j] / np.linalg.norm(m["jnt_axis"][j])
                there, back = np.eye(4), np.eye(4)
                there[:3, 3], back[:3, 3] = m["jnt_pos"][j], -m["jnt_pos"][j]
                ref = float(m["qpos0"][m["jnt_qposadr"][j]])
                limited = bool(m["jnt_limited"][j])
                low, high = m["jnt_range"][j] if limited else (-np.inf, np.inf)
                joints.append(
                    Joint(
                        name=self._joints[j], type=kind, parent=row,
                        origin=T @ there @ motion(kind, axis, -ref), axis=axis, q_min=float(low),
                        q_max=float(high), qd_max=np.nan, qdd_max=np.nan,
                    )
                )  # fmt: skip
                row, T = len(joints) - 1, back
            place.append((row, T))
        return joints, place

    def _shapes(self) -> dict[str, list[Shape]]:
        """What is drawn of each body; all it has where nothing is.

        Where some of it has no part in contacts, that is its look, and the rest is for contacts.
        """
        m = self._m
        found: dict[str, list[Shape]] = {}
        for body in range(len(self._parent)):
            geoms = [int(g) for g in np.flatnonzero(m["geom_bodyid"] == body)
                     if m["geom_type"][g] != _PLANE]  # fmt: skip
            if body in self._left_out or not geoms:
                continue
            seen = [g for g in geoms if m["geom_group"][g] < _HIDDEN_GROUP] or geoms
            look = [g for g in seen if not m["geom_contype"][g] and not m["geom_conaffinity"][g]]
            found[WORLD if body == 0 else self._bodies[body]] = [
                self._shape(geom) for geom in look or seen
            ]
        return found

    def _shape(self, geom: int) -> Shape:
        m = self._m
        kind, size, T = int(m["geom_type"][geom]), m["geom_size"][geom], self._pose("geom", geom)
        make: dict[int, Callable[[], Any]] = {
            _SPHERE: lambda: ellipsoid(np.full(3, size[0])),
            _CAPSULE: lambda: capsule(size[0], 2 * size[1]),
            _ELLIPSOID: lambda: ellipsoid(size),
            _CYLINDER: lambda: cylinder(size[0], 2 * size[1]),
            _BOX: lambda: box(2 * size),
        }
        if kind in make:
            return Shape(T, mesh=make[kind]())
        if kind != _MESH:
            name = self._reply["geoms"][geom] or "?"
            raise ModelError(f"{self._path}: geom '{name}' of body "
                             f"'{self._bodies[m['geom_bodyid'][geom]]}' is not read; primitives "
                             "and meshes are")  # fmt: skip
        mesh = int(m["geom_dataid"][geom])
        name = self._reply["mesh_names"][mesh]
        if name in self._reply["stubs"]:
            told = self._reply["meshes"][name]
            # MuJoCo moves a mesh by refpos and refquat first, then scales it.
            moved_by = inverse(pose_of(np.array(told["refpos"]), np.array(told["refquat"])))
            return Shape(T @ np.linalg.inv(self._pose("mesh", mesh)), file=self._paths[name],
                         scale=np.array(told["scale"]), before_scale=moved_by)  # fmt: skip
        first, face = m["mesh_vertadr"][mesh], m["mesh_faceadr"][mesh]
        vertices = m["mesh_vert"][first : first + m["mesh_vertnum"][mesh]].astype(np.float64)
        faces = m["mesh_face"][face : face + m["mesh_facenum"][mesh]].astype(np.int64)
        return Shape(T, mesh=(vertices, faces))


def pose_of(position: Array, quaternion: Array) -> Array:
    """T (4, 4) of a position and a quaternion (w, x, y, z) of any length but 0."""
    w, x, y, z = np.asarray(quaternion) / np.linalg.norm(quaternion)
    T = np.eye(4)
    T[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    T[:3, 3] = position
    return T


def _unique(names: list[str], kind: str) -> list[str]:
    """The names, and made-up ones for those without: `body3`, where no other is called so."""
    taken, made = set(names), []
    for row, name in enumerate(names):
        own = name or f"{kind}{row}"
        while not name and own in taken:
            own += "_"
        taken.add(own)
        made.append(own)
    return made

"""Random robots, each written as URDF, as xacro and as MJCF, with their kinematics by hand."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

Array = np.ndarray


def rotation(axis: Array, angle: float) -> Array:
    """(4, 4) turn about an axis through the origin."""
    x, y, z = axis / np.linalg.norm(axis)
    c, s = np.cos(angle), np.sin(angle)
    T = np.eye(4)
    T[:3, :3] = [
        [c + x * x * (1 - c), x * y * (1 - c) - z * s, x * z * (1 - c) + y * s],
        [y * x * (1 - c) + z * s, c + y * y * (1 - c), y * z * (1 - c) - x * s],
        [z * x * (1 - c) - y * s, z * y * (1 - c) + x * s, c + z * z * (1 - c)],
    ]
    return T


def shift(xyz: Array) -> Array:
    T = np.eye(4)
    T[:3, 3] = xyz
    return T


def from_rpy(xyz: Array, rpy: Array) -> Array:
    """(4, 4) as URDF has it: about fixed x, then y, then z."""
    x, y, z = np.eye(3)
    return shift(xyz) @ rotation(z, rpy[2]) @ rotation(y, rpy[1]) @ rotation(x, rpy[0])


def rpy_of(T: Array) -> Array:
    R = T[:3, :3]
    return np.array([np.arctan2(R[2, 1], R[2, 2]), -np.arcsin(np.clip(R[2, 0], -1, 1)),
                     np.arctan2(R[1, 0], R[0, 0])])  # fmt: skip


def quat_of(T: Array) -> Array:
    """(w, x, y, z), by the largest eigenvector of Bar-Itzhack's matrix."""
    R = T[:3, :3]
    K = np.array([
        [R[0, 0] - R[1, 1] - R[2, 2], 0, 0, 0],
        [R[1, 0] + R[0, 1], R[1, 1] - R[0, 0] - R[2, 2], 0, 0],
        [R[2, 0] + R[0, 2], R[2, 1] + R[1, 2], R[2, 2] - R[0, 0] - R[1, 1], 0],
        [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], R[0, 0] + R[1, 1] + R[2, 2]],
    ])  # fmt: skip
    _, vectors = np.linalg.eigh(K / 3)
    x, y, z, w = vectors[:, -1]
    return np.array([w, x, y, z])


@dataclass
class Part:
    """One shape of a link, at T in the link's frame."""

    kind: str  # box, cylinder, sphere or mesh
    size: Array  # full sizes; radius and length; radius; or the mesh's scale
    T: Array


@dataclass
class Body:
    """One link and the joint that carries it."""

    parent: int
    kind: str  # revolute, prismatic or fixed
    T: Array  # of the joint in the parent's link frame, at q = 0
    axis: Array
    limits: tuple[float, float]
    speed: float
    parts: list[Part] = field(default_factory=list)


class RandomRobot:
    """A tree of links; link 0 is the base."""

    def __init__(self, seed: int) -> None:
        rng = self.rng = np.random.default_rng(seed)
        self.bodies = [Body(-1, "fixed", np.eye(4), np.eye(3)[2], (0, 0), 1.0)]
        self.mesh_name = f"part{rng.integers(2)}." + ("stl", "obj")[rng.integers(2)]
        for row in range(1, int(rng.integers(2, 8))):
            parent = row - 1 if rng.random() < 0.85 else int(rng.integers(row))
            kind = "revolute" if row == 1 else str(rng.choice(
                ["revolute", "prismatic", "fixed"], p=[0.65, 0.2, 0.15]))  # fmt: skip
            reach = 3.0 if kind == "revolute" else 0.4
            low = float(np.round(rng.uniform(-reach, -0.1), 6))
            high = float(np.round(rng.uniform(0.1, reach), 6))
            T = from_rpy(rng.uniform(-0.5, 0.5, 3), rng.uniform(-1.5, 1.5, 3))
            axis = rng.normal(size=3)
            if rng.random() < 0.5:
                axis = np.eye(3)[rng.integers(3)] * rng.choice([-1.0, 1.0])
            self.bodies.append(
                Body(parent, kind, T, axis, (low, high), float(np.round(rng.uniform(0.5, 3), 3)))
            )
        for row, body in enumerate(self.bodies):
            if row == 1 or rng.random() < 0.8:
                body.parts = [self._part() for _ in range(int(rng.integers(1, 3)))]

    def _part(self) -> Part:
        rng = self.rng
        kind = str(rng.choice(["box", "cylinder", "sphere", "mesh"]))
        size = {"box": rng.uniform(0.02, 0.3, 3), "cylinder": rng.uniform(0.02, 0.3, 2),
                "sphere": rng.uniform(0.02, 0.2, 1),
                "mesh": rng.uniform(0.3, 2.0, 3) * rng.choice([-1.0, 1.0], 3, p=[0.2, 0.8]),
                }[kind]  # fmt: skip
        return Part(kind, size, from_rpy(rng.uniform(-0.2, 0.2, 3), rng.uniform(-1.5, 1.5, 3)))

    @property
    def moving(self) -> list[int]:
        """Rows of the links with a joint of their own, in the order of the file."""
        return [row for row, body in enumerate(self.bodies) if body.kind != "fixed"]

    def poses(self, q: dict[str, float]) -> list[Array]:
        """T (4, 4) of each link in the base's frame."""
        found: list[Array] = []
        for row, body in enumerate(self.bodies):
            T = body.T if body.parent < 0 else found[body.parent] @ body.T
            if body.kind == "revolute":
                T = T @ rotation(body.axis, q[f"j{row}"])
            elif body.kind == "prismatic":
                T = T @ shift(body.axis / np.linalg.norm(body.axis) * q[f"j{row}"])
            found.append(T)
        return found

    # Every writer puts the mesh beside the file.

    def write(self, folder: Path) -> dict[str, Path]:
        """The three files, by format."""
        write_mesh(folder / self.mesh_name)
        written = {}
        for name, text in (("urdf", self.urdf()), ("xml", self.mjcf())):
            written[name] = folder / f"robot.{name}"
            written[name].write_text(text)
        written["xacro"] = self.xacro(folder)
        return written

    def urdf(self) -> str:
        """All of it as URDF."""
        rows = range(len(self.bodies))
        return '<robot name="r">' + "".join(self._urdf_body(row) for row in rows) + "</robot>"

    def _urdf_body(self, row: int) -> str:
        body = self.bodies[row]
        looks = "".join(
            f"<visual>{_origin(part.T)}<geometry>{self._urdf_shape(part)}</geometry></visual>"
            for part in body.parts
        )
        text = f'<link name="l{row}">{looks}</link>'
        if row:
            low, high = body.limits
            limit = (
                f'<limit lower="{low!r}" upper="{high!r}" velocity="{body.speed!r}" effort="1"/>'
            )
            text += (
                f'<joint name="j{row}" type="{body.kind}"><parent link="l{body.parent}"/>'
                f'<child link="l{row}"/>{_origin(body.T)}<axis xyz="{_n(body.axis)}"/>'
                f"{limit if body.kind != 'fixed' else ''}</joint>"
            )
        return text

    def _urdf_shape(self, part: Part) -> str:
        if part.kind == "box":
            return f'<box size="{_n(part.size)}"/>'
        if part.kind == "cylinder":
            return f'<cylinder radius="{_n(part.size[0])}" length="{_n(part.size[1])}"/>'
        if part.kind == "sphere":
            return f'<sphere radius="{_n(part.size[0])}"/>'
        return f'<mesh filename="{self.mesh_name}" scale="{_n(part.size)}"/>'

    def xacro(self, folder: Path) -> Path:
        """The URDF with a property, a macro, an argument, an included file and limits in YAML."""
        space = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
        (folder / "parts").mkdir(exist_ok=True)
        half = len(self.bodies) // 2 + 1
        limits = "".join(
            f"j{row}: [{float(b.limits[0])!r}, {float(b.limits[1])!r}]\n"
            for row, b in enumerate(self.bodies)
        )
        (folder / "parts" / "limits.yaml").write_text(limits)
        (folder / "parts" / "rest.xacro").write_text(
            f"<robot {space}>" + "".join(self._xacro_body(r) for r in range(half, len(self.bodies)))
            + "</robot>"
        )  # fmt: skip
        path = folder / "robot.xacro"
        path.write_text(
            f'<robot name="r" {space}><xacro:arg name="speed_factor" default="7"/>'
            '<xacro:property name="limits" value="${xacro.load_yaml(\'parts/limits.yaml\')}"/>'
            + "".join(self._xacro_body(row) for row in range(half))
            + '<xacro:include filename="parts/rest.xacro"/></robot>'
        )
        return path

    def _xacro_body(self, row: int) -> str:
        text, body = self._urdf_body(row), self.bodies[row]
        for side, value in zip(("lower", "upper"), body.limits, strict=True):
            at = ("lower", "upper").index(side)
            text = text.replace(f'{side}="{value!r}"', f"{side}=\"${{limits['j{row}'][{at}]}}\"")
        return text.replace(
            f'velocity="{body.speed!r}"', f'velocity="${{{body.speed!r} * $(arg speed_factor)}}"'
        )

    def mjcf(self) -> str:
        """As MJCF: bodies with frames of their own, places and references of joints, classes."""
        rng = self.rng
        degrees = bool(rng.integers(2))
        self.own = [np.eye(4)] + [
            from_rpy(rng.uniform(-0.2, 0.2, 3), rng.uniform(-1, 1, 3)) for _ in self.bodies[1:]
        ]  # of each body's frame in the link's
        order = str(rng.choice(["xyz", "zyx", "XYZ", "ZYX", "xzx"]))
        children = [[r for r, b in enumerate(self.bodies) if b.parent == row]
                    for row in range(len(self.bodies))]  # fmt: skip
        assets, seen = [], {}
        for body in self.bodies:
            for part in body.parts:
                if part.kind == "mesh":
                    seen[id(part)] = name = f"m{len(seen)}"
                    assets.append(f'<mesh name="{name}" file="{self.mesh_name}" '
                                  f'scale="{_n(part.size)}"/>')  # fmt: skip

        def text_of(row: int) -> str:
            body, C = self.bodies[row], self.own[row]
            back = np.linalg.inv(C)
            # MuJoCo wants a mass of what moves.
            inside = "" if body.parts else ('<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>')
            placed = np.linalg.inv(self.own[body.parent]) @ body.T if row else np.eye(4)
            if body.kind != "fixed":
                slides = body.kind == "prismatic"
                unit = 1.0 if slides or not degrees else np.degrees(1.0)
                ref = float(rng.uniform(-1, 1)) if rng.random() < 0.5 else 0.0
                axis = body.axis / np.linalg.norm(body.axis)
                placed = placed @ (shift(axis * ref) if slides else rotation(axis, ref))
                low, high = body.limits
                kind = ' class="sliding"' if slides else ""
                inside += (
                    f'<joint name="j{row}"{kind} pos="{_n(back[:3, 3])}" ref="{_n(ref * unit)}" '
                    f'axis="{_n(back[:3, :3] @ axis)}" range="{_n(np.array([low, high]) * unit)}"/>'
                )
            placed = placed @ C
            for part in body.parts:
                sizes = {"box": part.size / 2, "cylinder": part.size / [1, 2] if len(part.size) == 2
                         else part.size, "sphere": part.size}.get(part.kind)  # fmt: skip
                shape = (f'type="mesh" mesh="{seen[id(part)]}"' if sizes is None
                         else f'type="{part.kind}" size="{_n(sizes)}"')  # fmt: skip
                T = back @ part.T
                inside += f'<geom {shape} pos="{_n(T[:3, 3])}" quat="{_n(quat_of(T))}"/>'
            inside += "".join(text_of(child) for child in children[row])
            turn = f'quat="{_n(quat_of(placed))}"'
            if order == "zyx" and rng.random() < 0.5:  # about z, then the new y, then the new x
                turned = rpy_of(placed)[::-1] * (np.degrees(1.0) if degrees else 1.0)
                turn = f'euler="{_n(turned)}"'
            body_text = f'<body name="l{row}" pos="{_n(placed[:3, 3])}" {turn}>{inside}</body>'
            if rng.random() < 0.2 and row:
                body_text = body_text.replace(f' pos="{_n(placed[:3, 3])}"', "", 1)
                body_text = f'<frame pos="{_n(placed[:3, 3])}">{body_text}</frame>'
            return body_text

        angle = "degree" if degrees else "radian"
        return (
            f'<mujoco model="r"><compiler angle="{angle}" eulerseq="{order}"/>'
            '<default><default class="sliding"><joint type="slide"/></default></default>'
            f"<asset>{''.join(assets)}</asset><worldbody>{text_of(0)}</worldbody></mujoco>"
        )


def _n(values: Array) -> str:
    return " ".join(repr(float(value)) for value in np.atleast_1d(values))


def _origin(T: Array) -> str:
    return f'<origin xyz="{_n(T[:3, 3])}" rpy="{_n(rpy_of(T))}"/>'


V = np.array([[x, y, z] for x in (0.0, 0.1) for y in (0.0, 0.2) for z in (-0.1, 0.3)])
F = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
              [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])  # fmt: skip


def write_mesh(path: Path) -> None:
    """A box of 0.1 x 0.2 x 0.4 m off its frame, as STL or OBJ."""
    if path.suffix == ".obj":
        path.write_text("".join(f"v {_n(v)}\n" for v in V)
                        + "".join("f {} {} {}\n".format(*(f + 1)) for f in F))  # fmt: skip
        return
    out = b"x".ljust(80, b"\0") + struct.pack("<I", len(F))
    for face in F:
        a, b, c = V[face]
        n = np.cross(b - a, c - a)
        out += struct.pack("<12fH", *(n / np.linalg.norm(n)), *a, *b, *c, 0)
    path.write_bytes(out)

"""Robots given as a list of capsules in a TOML file: links, joints, and what physics needs."""

import math
import tomllib
from functools import cached_property
from pathlib import Path
from typing import Annotated, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from proxcgal._core import Capsule, LinkCapsule
from proxcgal.core.errors import ModelError
from proxcgal.core.schema import NonNegative, Positive, Vector
from proxcgal.core.transforms import pose
from proxcgal.core.typing import Array
from proxcgal.models.description import Frame, Joint, Link, RobotDescription
from proxcgal.models.mesh.shapes import capsule_between

Range = Annotated[tuple[float, ...], Field(min_length=2, max_length=2)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class CapsuleLink(_Table):
    """One link: a capsule, the joint that moves it, and what it weighs."""

    name: str = Field(min_length=1, description="of the link")
    joint: str | None = Field(None, description="left out: fixed to the link before")
    origin: Vector = Field((0.0, 0.0, 0.0), description="[m] of its frame in the link's before")
    rpy: Vector = Field((0.0, 0.0, 0.0), description="[rad] roll, pitch, yaw of its frame")
    axis: Vector = Field((0.0, 0.0, 1.0), description="of the joint, in the link's frame")
    range: Range = Field((-math.pi, math.pi), description="[rad] least and most")
    speed: Positive | None = Field(None, description="[rad/s] most")
    acceleration: Positive | None = Field(None, description="[rad/s^2] most")
    start: Vector = Field(description="[m] of the capsule's axis, in the link's frame")
    end: Vector = Field(description="[m] of the capsule's axis, in the link's frame")
    radius: Positive = Field(description="[m]")
    mass: Positive | None = Field(None, description="[kg] spread evenly over the capsule")
    armature: NonNegative = Field(0.0, description="[kg m^2] of the drive, at the joint")
    damping: NonNegative = Field(0.0, description="[N m s/rad] of the joint")
    brake: Positive | None = Field(None, description="[N m] that the holding brake gives")

    @model_validator(mode="after")
    def _moves(self) -> Self:
        if self.joint is not None and not np.linalg.norm(self.axis) > 0.0:
            raise ValueError("axis must not be zero")
        if self.range[0] >= self.range[1]:
            raise ValueError(f"range = {list(self.range)}: the first must be below the second")
        return self


class BrakeTiming(_Table):
    """How brakes close once the torque is off."""

    delay: NonNegative = Field(0.03, description="[s] until they begin to")
    rise: NonNegative = Field(0.02, description="[s] from then until they hold in full")


class Tool(_Table):
    """The tool frame."""

    name: str = Field("TCP", description="of the frame")
    link: str = Field(description="that carries it")
    position: Vector = Field((0.0, 0.0, 0.0), description="[m] in that link's frame")
    rpy: Vector = Field((0.0, 0.0, 0.0), description="[rad] roll, pitch, yaw")


class CapsuleRobot(_Table):
    """A chain of links, base first."""

    name: str = Field(min_length=1)
    links: tuple[CapsuleLink, ...] = Field(alias="link", min_length=1)
    tool: Tool
    brakes: BrakeTiming = Field(default_factory=BrakeTiming)

    @model_validator(mode="after")
    def _named(self) -> Self:
        names = [link.name for link in self.links]
        joints = [link.joint for link in self.links if link.joint is not None]
        for kind, given in (("link", names), ("joint", joints)):
            if twice := sorted({name for name in given if given.count(name) > 1}):
                raise ValueError(f"more than one {kind} is called {', '.join(twice)}")
        if not joints:
            raise ValueError("no link has a joint: nothing moves")
        if self.tool.link not in names:
            raise ValueError(f"tool.link = {self.tool.link!r}: there are {', '.join(names)}")
        return self

    @property
    def moving(self) -> tuple[CapsuleLink, ...]:
        """Links that a joint of their own moves, in the order of q."""
        return tuple(link for link in self.links if link.joint is not None)

    def capsules(self) -> list[LinkCapsule]:
        """One for each link, in its frame: what the guard monitors."""
        return [
            LinkCapsule(link.name, row, Capsule(link.start, link.end, link.radius))
            for row, link in enumerate(self.links)
        ]

    @cached_property
    def placed(self) -> list[tuple[int, Array]]:
        """Of each link: the joint that moves it (-1: none), and its frame in that joint's."""
        found: list[tuple[int, Array]] = []
        joint, T_JL = -1, np.eye(4)
        for link in self.links:
            if link.joint is None:
                T_JL = T_JL @ pose(link.origin, link.rpy)
            else:
                joint, T_JL = joint + 1, np.eye(4)
            found.append((joint, T_JL))
        return found

    def description(self, source: str) -> RobotDescription:
        """The robot as any other, its meshes made from the capsules."""
        joints, links = [], []
        for row, link in enumerate(self.links):
            joint, T_JL = self.placed[row]
            if link.joint is not None:
                before = self.placed[row - 1] if row else (-1, np.eye(4))
                low, high = link.range
                joints.append(
                    Joint(
                        name=link.joint, type="revolute", parent=before[0],
                        origin=before[1] @ pose(link.origin, link.rpy),
                        axis=np.array(link.axis) / np.linalg.norm(link.axis),
                        q_min=low, q_max=high, qd_max=link.speed or math.nan,
                        qdd_max=link.acceleration or math.nan,
                    )
                )  # fmt: skip
            vertices, triangles = capsule_between(
                np.array(link.start), np.array(link.end), link.radius
            )
            links.append(
                Link(name=link.name, joint=joint, T_JL=T_JL, vertices_L=vertices,
                     triangles=triangles)
            )  # fmt: skip
        joint, T_JL = self.placed[[link.name for link in self.links].index(self.tool.link)]
        tool = Frame(
            name=self.tool.name, joint=joint,
            T_JF=T_JL @ pose(self.tool.position, self.tool.rpy),
        )  # fmt: skip
        return RobotDescription(
            name=self.name, joints=tuple(joints), links=tuple(links), frames=(tool,),
            tool=tool.name, source=source,
        )  # fmt: skip


def read_capsule_robot(path: Path) -> CapsuleRobot:
    """Reads a robot from its TOML file.

    Raises:
        ModelError: all that is wrong, one line each: file, key, what is allowed.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not a text file"
        raise ModelError(f"{path}: {reason}") from None
    except tomllib.TOMLDecodeError as error:
        raise ModelError(f"{path}: not TOML: {error}") from None
    try:
        return CapsuleRobot.model_validate(table)
    except ValidationError as error:
        lines = [
            f"{path}: {'.'.join(map(str, problem['loc'])) or 'file'}: {problem['msg']}"
            for problem in error.errors()
        ]
        raise ModelError("\n".join(lines)) from None

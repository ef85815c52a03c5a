"""What a robot is made of, read from a file and independent of the C++ core."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from proxcgal.core.errors import ModelError
from proxcgal.core.typing import Array, Ints


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Joint:
    """One moving joint; fixed joints are folded into `origin`."""

    name: str
    type: Literal["revolute", "prismatic"]
    parent: int  # row of the joint it hangs on, -1 for the base
    origin: Array  # (4, 4) joint frame at q = 0 in the parent joint's frame
    axis: Array  # (3,) unit, in the joint frame
    q_min: float  # [rad] or [m]
    q_max: float  # [rad] or [m]
    qd_max: float  # [rad/s] or [m/s]; nan where the description gives none
    qdd_max: float  # [rad/s^2] or [m/s^2]; nan where the description gives none


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Link:
    """One rigid link that carries a mesh, at full resolution."""

    name: str
    joint: int  # the joint that moves it, -1 for the base
    T_JL: Array  # (4, 4) link frame in that joint's frame
    vertices_L: Array  # (v, 3) [m]
    triangles: Ints  # (f, 3)
    dropped_faces: int = 0  # faces without area, left out


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Frame:
    """A named frame that can be a tool, or that another robot can be put on."""

    name: str
    joint: int  # the joint that moves it, -1 for the base
    T_JF: Array  # (4, 4) in that joint's frame


@dataclass(frozen=True, kw_only=True, eq=False)
class RobotDescription:
    """A tree of joints with its links. The base stands at the world's origin.

    The simulator takes its meshes from here, at full resolution; the controller's coarser ones are
    made from them.
    """

    name: str
    joints: tuple[Joint, ...]  # parents before children
    links: tuple[Link, ...]  # base first
    frames: tuple[Frame, ...]
    tool: str  # name of one of the frames; "" where several chains end and none is called a tool
    source: str  # the file it was read from
    ends: tuple[str, ...] = ()  # frames of the moving links that carry no other
    notes: tuple[str, ...] = ()  # what a user of the file is to be warned of

    @property
    def link_names(self) -> list[str]:
        """Links that carry a mesh, base first."""
        return [link.name for link in self.links]

    @property
    def joint_names(self) -> list[str]:
        """In the order of q."""
        return [joint.name for joint in self.joints]

    @cached_property
    def tool_frame(self) -> Frame:
        """The frame that `tool` names.

        Raises:
            ModelError: which frame is the tool has not been said.
        """
        if not self.tool:
            raise ModelError(
                f"{self.source}: {len(self.ends)} links carry no other: {listed(self.ends)}; tool= "
                f"says which frame is the tool: one of these, or of all frames, "
                f"{listed(frame.name for frame in self.frames)}"
            )
        return self.frame(self.tool)

    def frame(self, name: str) -> Frame:
        """A frame by its name.

        Raises:
            ModelError: there is none of that name; lists those there are.
        """
        for frame in self.frames:
            if frame.name == name:
                return frame
        raise ModelError(
            f"robot '{self.name}' has no frame '{name}'; it has "
            f"{listed(frame.name for frame in self.frames)}"
        )

    def link_row(self, name: str) -> int:
        """Row of a link.

        Raises:
            ModelError: there is none of that name; lists those there are.
        """
        for row, link in enumerate(self.links):
            if link.name == name:
                return row
        raise ModelError(
            f"robot '{self.name}' has no link '{name}' with a mesh; it has "
            f"{listed(self.link_names)}"
        )

    def __repr__(self) -> str:
        """One line: what there is of it."""
        faces = sum(len(link.triangles) for link in self.links)
        return (
            f"<RobotDescription '{self.name}': {len(self.joints)} joints, {len(self.links)} links "
            f"with {faces} triangles, tool '{self.tool}'>"
        )


def listed(names: Iterable[str]) -> str:
    """Names as they stand in messages: 'a', 'b', 'c'."""
    return ", ".join(f"'{name}'" for name in names) or "none"

"""The keys of a scenario's `[[obstacle]]`: shape, place and path of a solid."""

from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from proxcgal.core.schema import Positive, Section, Vector
from proxcgal.core.transforms import pose
from proxcgal.core.typing import Array
from proxcgal.scene.solids import Box, CapsuleSolid, Cylinder, Solid, Sphere

_PathStop = Annotated[tuple[float, ...], Field(min_length=4, max_length=4)]
#: How many numbers `size` has for each shape.
_SIZES = {"box": 3, "cylinder": 2, "capsule": 2, "sphere": 1}


class Obstacle(Section):
    """A solid that stands still, or moves on a path of its own."""

    sensed: bool = Field(
        True, description="false: only drawn, neither seen by sensors, known, nor measured against"
    )
    name: str = Field("panel", description="for messages and pictures")
    shape: Literal["box", "cylinder", "capsule", "sphere"] = Field(
        "box", description="round ones stand along their own z axis"
    )
    size: tuple[Positive, ...] = Field(
        min_length=1,
        max_length=3,
        description="[m] box: full edge lengths x, y, z; cylinder: radius, height; capsule: "
        "radius, length between the middles of its ends; sphere: radius",
    )
    position: Vector = Field(description="[m] of its centre, in the base frame")
    rpy: Vector = Field((0.0, 0.0, 0.0), description="[rad] roll, pitch, yaw")
    path: tuple[_PathStop, ...] = Field(
        (),
        description="[s, m, m, m] time and position of each stop, straight at even speed between "
        "them, at rest before and after; left out: stands at `position`",
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if len(self.size) != _SIZES[self.shape]:
            raise ValueError(f"size of a {self.shape} has {_SIZES[self.shape]} numbers")
        times = [stop[0] for stop in self.path]
        if any(later <= earlier for earlier, later in pairwise(times)):
            raise ValueError("path must go on in time from stop to stop")
        if self.path and self.path[0][1:] != self.position:
            raise ValueError(f"path must begin at position = {list(self.position)}")
        return self

    def solid(self) -> Solid:
        """Its shape."""
        match self.shape:
            case "box":
                return Box(self.size)
            case "cylinder":
                return Cylinder(*self.size)
            case "capsule":
                return CapsuleSolid(*self.size)
        return Sphere(*self.size)

    def pose(self) -> Array:
        """(4, 4) T_WO of its centre, at the start."""
        return pose(self.position, self.rpy)

"""The keys of a scenario's `[skin]`: rings of sensors, and their model."""

import math
from typing import Annotated, Literal

from pydantic import Field

from proxcgal.core.schema import Count, NonNegative, Positive, Section, Share, like


class RingKeys(Section):
    """Rings of sensors round one link."""

    link: str = Field(description="name of a link that carries a mesh")
    at: tuple[Share, ...] = Field(
        min_length=1, description="one ring at each of these fractions of the link's length"
    )
    sensors: Count = Field(description="evenly round each ring")
    phase: float = Field(0.0, description="[rad] turns each ring about the link's axis")
    axis: Literal["x", "y", "z"] | None = Field(
        None, description="of the link's frame, for rings round another than its longest side"
    )
    standoff: NonNegative | None = Field(
        None, description="[m] height above the surface; left out: that of `px.ring_skin`"
    )


class SensorKeys(Section):
    """What the controller takes a sensor for (VL53L8CX)."""

    field_of_view: Annotated[float, Field(gt=0, lt=math.pi)] = like(
        "SensorModel", "field_of_view", "[rad] along one side of the 8 x 8 zones"
    )
    min_range: NonNegative = like("SensorModel", "min_range", "[m] along the sensor's z axis")
    max_range: Positive = like("SensorModel", "max_range", "[m] along the sensor's z axis")
    workspace: Positive = like(
        "SensorModel", "workspace", "[m] along the ray; farther points are cropped"
    )
    sigma_floor: NonNegative = like(
        "SensorModel", "sigma_floor", "[m] least standard deviation the filter reckons with"
    )
    sigma_ratio: NonNegative = like(
        "SensorModel", "sigma_ratio", "of the range, where that is more than the floor"
    )
    range_model: Literal["tangent", "printed"] = like(
        "SensorModel", "range_model", "form of [WA] eq. (1)"
    )


class SkinKeys(Section):
    """The sensors on the robot."""

    rings: tuple[RingKeys, ...] = Field(min_length=1, description="at least one")
    optional: tuple[RingKeys, ...] = Field((), description="further rings, off unless asked for")
    with_optional: bool = Field(False, description="the rings of `optional` are there too")
    sensor: SensorKeys = Field(default_factory=SensorKeys)
    check_mounts: bool = Field(
        True,
        description="compare what sensors see of the arm itself with their mounts, 2 s before the "
        "run; wrong ones refuse it",
    )

    @property
    def fitted(self) -> tuple[RingKeys, ...]:
        """The rings that are on the robot."""
        return (*self.rings, *(self.optional if self.with_optional else ()))

"""The keys of a scenario's `[skin]`: rings of sensors, and their model."""

from typing import Literal

from pydantic import Field

from proxcgal.core.schema import Count, NonNegative, Section, Share, core_table


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


class SensorKeys(core_table("SensorModel")):
    """What the controller takes a sensor for (VL53L8CX)."""


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

"""The keys of a scenario file: their types, bounds, units and defaults.

SI units and radians; a default that the C++ core has is taken from there, never repeated. Those of
the control law stand in `scenario_law`.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Any, Literal, NamedTuple, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from proxcgal import _core
from proxcgal.core import transforms
from proxcgal.core.typing import Array
from proxcgal.scene.solids import Box, Capsule, Cylinder, Solid, Sphere

FaultKind = Literal[
    "silent",
    "frozen",
    "stuck_payload",
    "nan",
    "infinite",
    "negative",
    "zero",
    "status",
    "dropout",
    "offset",
    "delay",
    "duplicate",
    "stamp_offset",
    "swapped",
    "joints_old",
    "joints_nan",
    "clock_jump",
    "late",
    "mount_offset",
    "mount_turn",
]
#: Those of the tick's other inputs; `sensor` says nothing there.
INPUT_FAULTS = ("joints_old", "joints_nan", "clock_jump", "late")
#: Those of the world: where a sensor really sits, other than the skin says.
MOUNT_FAULTS = ("mount_offset", "mount_turn")


class FaultValue(NamedTuple):
    """What `value` means to a fault."""

    meaning: str
    default: float  #: where the file leaves it out
    least: float
    most: float


#: Of the kinds that take a value.
FAULT_VALUES = {
    "dropout": FaultValue("share of zones lost, 0 to 1", 0.5, 0.0, 1.0),
    "offset": FaultValue("added to every range [m]", 0.05, -10.0, 10.0),
    "delay": FaultValue("scans arrive this much later [s]", 0.1, 0.0, 3600.0),
    "status": FaultValue("every zone's status code, 0 to 255", 4.0, 0.0, 255.0),
    "stamp_offset": FaultValue("added to every scan's stamp [s]", 0.03, -1e6, 1e6),
    "joints_old": FaultValue("age of the joint state [s]", 0.05, 0.0, 1e6),
    "mount_offset": FaultValue(
        "how far the sensor sits from its mount, which way is drawn [m]", 0.005, -1.0, 1.0
    ),
    "mount_turn": FaultValue(
        "how far it is turned, about which axis is drawn [rad]", 0.0349, -math.pi, math.pi
    ),
    "clock_jump": FaultValue(
        "the caller's clock goes on from this much later, or earlier [s]", 3600.0, -1e6, 1e6
    ),
}


def _not_nan(value: float) -> float:
    if math.isnan(value):
        raise ValueError("must not be nan")
    return value


Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(ge=0, le=1)]
Count = Annotated[int, Field(ge=1)]
Vector = Annotated[tuple[float, ...], Field(min_length=3, max_length=3)]
Stop = Annotated[tuple[float, ...], Field(min_length=4, max_length=4)]
#: May be infinite: a bound that is off.
Bound = Annotated[float, Field(allow_inf_nan=True), AfterValidator(_not_nan)]


def like(
    struct: str,
    attribute: str,
    description: str,
    *,
    ge: float | None = None,
    le: float | None = None,
    lt: int | None = None,
) -> Any:
    """A field whose default is that of the core's struct; bounds as pydantic names them."""

    def default() -> Any:
        value = getattr(getattr(_core, struct)(), attribute)
        return tuple(value) if isinstance(value, list) else value

    return Field(default_factory=default, description=description, ge=ge, le=le, lt=lt)


class Section(BaseModel):
    """A table of the file: unknown keys are errors, values are not converted, nothing changes."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class Goal(Section):
    """Where the tool is to go: exactly one of `offset`, `position` and `waypoints`."""

    offset: Vector | None = Field(
        None, description="[m] in the base frame, from where the tool starts, orientation kept"
    )
    position: Vector | None = Field(None, description="[m] of the tool, in the base frame")
    waypoints: tuple[Vector, ...] | None = Field(
        None, min_length=2, description="[m] of the tool, one after the other, back and forth"
    )
    rpy: Vector | None = Field(
        None,
        description="[rad] roll, pitch, yaw beside `position` and `waypoints`; left out: "
        "orientation kept",
    )
    arrival: Positive = Field(0.02, description="[m] so near to a way point, the next one is due")
    patience: Positive = Field(10.0, description="[s] after which the next way point is due anyway")

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        forms = (self.offset, self.position, self.waypoints)
        if sum(form is not None for form in forms) != 1:
            raise ValueError("needs exactly one of offset, position and waypoints")
        if self.offset is not None and self.rpy is not None:
            raise ValueError("rpy goes with position and waypoints, offset keeps the orientation")
        return self


class Ring(Section):
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


class Sensor(Section):
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


class Skin(Section):
    """The sensors on the robot."""

    rings: tuple[Ring, ...] = Field(min_length=1, description="at least one")
    optional: tuple[Ring, ...] = Field((), description="further rings, off unless asked for")
    with_optional: bool = Field(False, description="the rings of `optional` are there too")
    sensor: Sensor = Field(default_factory=Sensor)
    check_mounts: bool = Field(
        True,
        description="compare what sensors see of the arm itself with their mounts, 2 s before the "
        "run; wrong ones refuse it",
    )

    @property
    def fitted(self) -> tuple[Ring, ...]:
        """The rings that are on the robot."""
        return (*self.rings, *(self.optional if self.with_optional else ()))


class Simulation(Section):
    """Rates, and what the simulated sensors really do."""

    control_hz: Positive = Field(100.0, ge=2, le=1e4, description="ticks a second, 2 to 10000")
    sensor_hz: Positive = Field(
        15.0, le=1e4, description="scans of each sensor a second, at most 10000"
    )
    stagger: bool = Field(False, description="sensors take turns instead of measuring at once")
    known_spacing: Positive = Field(
        0.01, description="[m] between known points, along the edges of the scene's surfaces"
    )
    sub_rays: Literal[1, 4, 9, 16] = Field(
        1, description="rays cast in each zone, of which the nearest counts"
    )
    sigma_floor: NonNegative = like("SensorModel", "sigma_floor", "[m] least noise of a range")
    sigma_ratio: NonNegative = like(
        "SensorModel", "sigma_ratio", "noise as a share of the range, where that is more"
    )
    bias: float = Field(0.0, description="[m] added to every range")
    dropout: Share = Field(0.02, description="share of zones that lose their target in a scan")
    uncertain: Share = Field(0.0, description="share of targets that come with status 6 or 9")
    resolution: NonNegative = Field(0.001, description="[m] ranges are rounded to it; 0: not")
    mounting: NonNegative = Field(
        0.005, description="[m] of each ray that lies inside the sensor's own mounting"
    )


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
    path: tuple[Stop, ...] = Field(
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
                return Capsule(*self.size)
        return Sphere(*self.size)

    def pose(self) -> Array:
        """(4, 4) T_WO of its centre, at the start."""
        return transforms.pose(self.position, self.rpy)


class Fault(Section):
    """Something that goes wrong between the sensors and the controller."""

    sensor: int | str = Field("all", description='row of the skin, name of a sensor, or "all"')
    kind: FaultKind = Field(description="what goes wrong")
    start: NonNegative = Field(0.0, alias="from", description="[s] first scan stamp concerned")
    end: Positive | None = Field(
        None, alias="to", description="[s] stamps from here on are fine again; left out: never"
    )
    value: float | None = Field(
        None, description="of the kind, in its unit; the table below has them"
    )
    axis: Literal["x", "y", "z"] | None = Field(
        None,
        description='"x", "y" or "z" of the sensor\'s frame, for mount_offset and mount_turn; '
        "left out: drawn",
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.end is not None and self.end <= self.start:
            raise ValueError(f"to = {self.end:g} must be later than from = {self.start:g}")
        if self.value is not None and self.kind not in FAULT_VALUES:
            raise ValueError(f"kind {self.kind} takes no value; {', '.join(FAULT_VALUES)} do")
        if self.axis is not None and self.kind not in MOUNT_FAULTS:
            raise ValueError(f"kind {self.kind} takes no axis; {', '.join(MOUNT_FAULTS)} do")
        if self.kind in INPUT_FAULTS and self.sensor != "all":
            raise ValueError(f"kind {self.kind} concerns no sensor: sensor is to be left out")
        if self.value is not None:
            allowed = FAULT_VALUES[self.kind]
            if not allowed.least <= self.value <= allowed.most:
                raise ValueError(
                    f"value = {self.value:g}, {allowed.meaning}: must be from {allowed.least:g} "
                    f"to {allowed.most:g}"
                )
            if self.kind == "status" and self.value != int(self.value):
                raise ValueError(f"value = {self.value:g}, {allowed.meaning}: must be whole")
        return self


class Limits(Section):
    """Limits of a user's own robot, where its description has none; one number is for all."""

    speed: Positive | tuple[Positive, ...] | None = Field(None, description="[rad/s] or [m/s]")
    acceleration: Positive | tuple[Positive, ...] | None = Field(
        None, description="[rad/s^2] or [m/s^2]"
    )

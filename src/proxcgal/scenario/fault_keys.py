"""The keys of a scenario's `[[fault]]`: what goes wrong, when, and by how much."""

import math
from typing import Literal, NamedTuple, Self

from pydantic import Field, model_validator

from proxcgal.core.schema import NonNegative, Positive, Section

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

"""Scenarios of a macro-micro robot: named initial configurations, a goal, and when a run ends."""

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from proxcgal.scenario.goal_keys import FinishKeys
from proxcgal.scenario.scenario import Scenario

Configuration = Annotated[tuple[float, ...], Field(min_length=1)]

#: Of kr150_ur10e [rad], the KUKA first. They come from the code of [JR]'s author, not from its
#: text. `mob_mob` violates the KUKA's A2: asked for, it is refused.
CONFIGURATIONS: dict[str, tuple[float, ...]] = {
    "free": (0.0, -2.1, 2.4, 0.0, -1.57, 0.0, 0.0, -1.57, 0.0, -1.57, 0.0, 0.0),
    "jl": (0.0, -1.5, 1.5, 0.0, 1.57, 0.0, 0.0, -1.57, 0.0, -1.57, 0.0, 0.0),
    "mob_mob": (0.0, 0.785398, -1.578, 0.0, 0.785398, 0.0,
                -3.14159, -2.10757, -1.83066, -0.774163, -1.5708, -0.0300288),
}  # fmt: skip


class JointScenario(Scenario):
    """One goal for the whole robot, from each of several initial configurations."""

    kind: Literal["joint"] = Field(description="what kind of scene this is")
    q0: tuple[float, ...] = Field(
        (), description="[rad] or [m] joint positions at 0 s, instead of those of `initial`"
    )
    perception: Literal["sensed", "known"] = Field(
        "known", description="what the controller gets: scans, or points of the scene itself"
    )
    initial: tuple[str, ...] = Field(
        ("free", "jl"), min_length=1, description="a run from each of these configurations"
    )
    configurations: dict[str, Configuration] = Field(
        default_factory=lambda: dict(CONFIGURATIONS),
        description="[rad] or [m] joint positions by name",
    )
    finish: FinishKeys = Field(default_factory=FinishKeys)

    @model_validator(mode="after")
    def _known_configurations(self) -> Self:
        for name in self.initial:
            if name not in self.configurations:
                raise ValueError(
                    f"initial names {name!r}: configurations has {', '.join(self.configurations)}"
                )
        if len(set(self.initial)) < len(self.initial):
            raise ValueError("initial names one of them twice")
        if not all(math.isfinite(q) for values in self.configurations.values() for q in values):
            raise ValueError("configurations must be finite")
        return self

    def start(self) -> tuple[str, tuple[float, ...]]:
        """Where a run begins: `q0` where the file has it, else the first of `initial`."""
        if self.q0:
            return super().start()
        name = self.initial[0]
        return f"configurations.{name}", self.configurations[name]

    def controllers(self) -> tuple[str, ...]:
        """Those of a run that names none: the whole body on what `perception` says."""
        return ("wb_known" if self.perception == "known" else "wb",)

    def ends(self) -> FinishKeys:
        """When a run is over before its time."""
        return self.finish

    def starts(self) -> list[Self]:
        """The same scene once from each configuration of `initial`."""
        return [self.model_copy(update={"initial": (name,)}) for name in self.initial]

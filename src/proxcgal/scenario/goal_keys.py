"""The keys of a scenario's `[goal]` and `[finish]`: where the tool goes, when a run is over."""

from typing import Self

from pydantic import Field, model_validator

from proxcgal.core.schema import Positive, Section, Vector


class GoalKeys(Section):
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


class FinishKeys(Section):
    """When a run has reached its goal, and when it is given up."""

    position: Positive = Field(0.03, description="[m] error at which the goal is reached")
    angle: Positive = Field(0.05, description="[rad] error at which it is, both together")
    patience: Positive = Field(
        5.0, description="[s] without progress after which the run is given up"
    )
    progress: Positive = Field(
        0.01, description="[m] or [rad] that the least error so far must fall by, to be progress"
    )

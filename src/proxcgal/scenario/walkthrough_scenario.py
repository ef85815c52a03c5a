"""Scenarios of an arm that a hand guides: taught and played back, or kept off a scene."""

from typing import Any, Literal, Self

from pydantic import Field, model_validator

from proxcgal.core import toml
from proxcgal.core.schema import Positive
from proxcgal.scenario.goal_keys import GoalKeys
from proxcgal.scenario.scenario import Scenario
from proxcgal.scenario.skin_keys import SensorKeys, SkinKeys
from proxcgal.scenario.walkthrough_keys import (
    AdmittanceKeys,
    ArmKeys,
    GuardKeys,
    HandKeys,
    LegKeys,
    PlaybackKeys,
)

#: Keys of other kinds of scene, which say nothing here.
_OTHERS = (
    "goal", "skin", "controller", "simulation", "obstacle", "fault", "perception", "limits"
)  # fmt: skip


class WalkScenario(Scenario):
    """A painting arm that a simulated operator guides by hand, watched by the guard."""

    kind: Literal["walkthrough"]
    duration: Positive = Field(120.0, description="[s] at most, of teaching")
    goal: GoalKeys = Field(default_factory=lambda: GoalKeys(offset=(0.0, 0.0, 0.0)))
    skin: SkinKeys = Field(
        default_factory=lambda: SkinKeys.model_construct(rings=(), sensor=SensorKeys())
    )
    guard: GuardKeys
    legs: tuple[LegKeys, ...] = Field(alias="leg", min_length=1, description="the wished path")
    hand: HandKeys = Field(default_factory=HandKeys)
    admittance: AdmittanceKeys = Field(default_factory=AdmittanceKeys)
    arm: ArmKeys = Field(default_factory=ArmKeys)
    playback: PlaybackKeys = Field(default_factory=PlaybackKeys)
    hand_guiding_speed: Positive = Field(
        0.25, description="[m/s] of the hand-guiding rules: the preset that teaching is compared to"
    )
    magnified: tuple[float, ...] | None = Field(
        None, min_length=2, max_length=2, description="[s] of the figure's window; none: the stop's"
    )

    ratings: str | None = Field(
        None, description="CSV of testers' ratings, 0 to 10, a column an indicator: drawn as Fig. 9"
    )

    @model_validator(mode="before")
    @classmethod
    def _nothing_else(cls, table: Any) -> Any:
        if isinstance(table, dict) and (given := [key for key in _OTHERS if key in table]):
            raise ValueError(f"{', '.join(given)}: a walk-through has no such table")
        return table

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.magnified is not None and self.magnified[0] >= self.magnified[1]:
            raise ValueError(f"magnified = {list(self.magnified)}: the first must be the earlier")
        return self

    def to_toml(self) -> str:
        """The file that gives this scenario again, with every default of its own written out."""
        return toml.write(
            {k: v for k, v in self.model_dump(by_alias=True).items() if k not in _OTHERS}
        )

    def slow(self) -> Self:
        """The same path under the hand-guiding rules: bound and wishes at that speed."""
        most = self.hand_guiding_speed
        guard = self.guard.model_copy(update={"tcp_speed": most})
        legs = tuple(
            leg.model_copy(update={"speed": min(leg.speed, _SLOW_SHARE * most)})
            for leg in self.legs
        )
        return self.model_copy(update={"guard": guard, "legs": legs})


class GuidedScenario(Scenario):
    """An arm with sensors that a hand guides, while its body keeps away from what they see.

    The twist that the hand asks for enters the stack as the reach levels' goal, ahead of the tool
    by that twist over `controller.reach_gain`: their rate, gain times what is left, is that twist.
    """

    kind: Literal["guided"]
    goal: GoalKeys = Field(default_factory=lambda: GoalKeys(offset=(0.0, 0.0, 0.0)))
    legs: tuple[LegKeys, ...] = Field(alias="leg", min_length=1, description="the wished path")
    hand: HandKeys = Field(default_factory=HandKeys)
    admittance: AdmittanceKeys = Field(default_factory=AdmittanceKeys)


_SLOW_SHARE = 0.9  # of the bound that an operator dares: as 1.17 m/s of 1.30

"""Scenario files of kind `walkthrough`: their keys, types, bounds, units and defaults."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from proxcgal import _core
from proxcgal.core import toml
from proxcgal.scenario.keys import Goal, NonNegative, Positive, Section, Sensor, Share, Skin
from proxcgal.scenario.keys import Vector as Vector3
from proxcgal.scenario.loading import Scenario

Vector6 = Annotated[tuple[float, ...], Field(min_length=6, max_length=6)]
#: Keys of other kinds of scene, which say nothing here.
_OTHERS = (
    "goal", "skin", "controller", "simulation", "obstacle", "fault", "perception", "limits"
)  # fmt: skip


def _admittance(attribute: str, description: str) -> Any:
    """A field whose default is that of the core."""
    value = getattr(_core.AdmittanceConfig(), attribute)
    plain = float(value) if isinstance(value, float) else tuple(float(v) for v in value)
    return Field(plain, description=description)


class Human(Section):
    """The operator's capsule, which rides on the tool and stands upright."""

    radius: Positive = Field(0.200, description="[m] opRad")
    height: Positive = Field(1.80, description="[m] opH, rounding included")
    offset: Vector3 = Field(
        (0.0, 0.0, 0.25), description="[m] opRelP, of its middle in the tool's frame"
    )


class Iso(Section):
    """What the separation distance of ISO/TS 15066 is computed with, beside the threshold."""

    human_speed: NonNegative = Field(1.6, description="[m/s] v_h")
    reaction_time: NonNegative = Field(1.0 / 15.0, description="[s] T_r, one frame of a sensor")
    intrusion: NonNegative = Field(0.0, description="[m] C")
    human_uncertainty: NonNegative = Field(0.0, description="[m] Z_d")
    robot_uncertainty: NonNegative = Field(0.0, description="[m] Z_r")


class Guard(Section):
    """The guard: [WT] section 3."""

    tcp_speed: Positive = Field(1.30, description="[m/s] xd_UB")
    stop_time: Positive = Field(0.35, description="[s] stopT, declared")
    rest_speed: Positive = Field(0.01, description="[rad/s] of every joint, at rest")
    max_gap: Positive = Field(0.0025, description="[s] a longer cycle cuts the torque")
    min_distance: NonNegative = Field(0.455, description="[m] minDistTh")
    max_velocity: Positive = Field(1.30, description="[m/s] maxVelTh")
    q_reference: tuple[float, ...] = Field(min_length=1, description="[rad] posture of eq. (1)")
    pairs: tuple[str, ...] = Field((), description="links whose distance counts; none: all")
    ends: tuple[str, ...] = Field(
        (), description="links whose far end's velocity counts; none: all"
    )
    subtract_human: bool = Field(False, description="velocity relative to the tool's operator")
    accept: tuple[str, ...] = Field((), description="contradictions to take as they are, by item")
    human: Human = Field(default_factory=Human)
    iso: Iso = Field(default_factory=Iso)


class Admittance(Section):
    """M a + D v = F: three linear and three angular axes, in the base frame."""

    mass: Vector6 = _admittance("mass", "[kg], [kg m^2] M")
    damping: Vector6 = _admittance("damping", "[N s/m], [N m s/rad] D")
    dead_band: Vector6 = _admittance("dead_band", "[N], [N m]")
    max_force: Vector6 = _admittance("max_force", "[N], [N m]")
    engage_time: NonNegative = _admittance(
        "engage_time", "[s] in which the hand is let in, and let go"
    )


class Hand(Section):
    """The operator's hand: spring and damper that pull the handle along the wished path."""

    stiffness: Positive = Field(400.0, description="[N/m]")
    damping: NonNegative = Field(60.0, description="[N s/m]")
    max_force: Positive = Field(120.0, description="[N] two hands can do")
    turn_stiffness: Positive = Field(25.0, description="[N m/rad]")
    turn_damping: NonNegative = Field(3.0, description="[N m s/rad]")
    max_torque: Positive = Field(15.0, description="[N m]")
    tremor: NonNegative = Field(1.5, description="[N] rms, 8 to 12 Hz, each axis")
    reaction_time: NonNegative = Field(
        0.20, description="[s] from the start's signal to the pull, and from a stop to letting go"
    )


class Leg(Section):
    """One leg of the wished path, from rest to rest."""

    to: Vector3 = Field((0.0, 0.0, 0.0), description="[m] from where the tool starts, base axes")
    turn: Vector3 = Field(
        (0.0, 0.0, 0.0), description="[rad] rotation vector from where it starts, base axes"
    )
    speed: Positive = Field(description="[m/s] at most")
    turn_speed: Positive = Field(1.0, description="[rad/s] at most")
    ramp: Positive = Field(0.8, description="[s] from rest to full speed, and back")
    wait: NonNegative = Field(0.1, description="[s] at its end")


class Playback(Section):
    """How what was taught is cleaned and run."""

    tolerance: Positive = Field(0.001, description="[m] smoothing moves the tool by at most this")
    step: Positive = Field(0.004, description="[s] between samples of the cleaned path")
    scale: Positive = Field(1.0, description="of the recorded timing: 2 takes twice as long")
    margin: Share = Field(0.95, description="of the guard's bounds that timing may use")
    start_tolerance: Positive = Field(0.005, description="[m] of the tool from the path's start")
    approach_speed: Positive = Field(
        0.25, description="[m/s] of the tool on its way there, at most"
    )


class Arm(Section):
    """What the simulated arm is like, and what it is allowed."""

    payload: NonNegative = Field(0.0, description="[kg] more, at the tool")
    brake_scale: Positive = Field(1.0, description="of the brakes' torques")
    command_share: Share = Field(
        0.7, description="of the guard's acceleration bounds that commands may use"
    )


class WalkScenario(Scenario):
    """A painting arm that a simulated operator guides by hand, watched by the guard."""

    kind: Literal["walkthrough"]
    duration: Positive = Field(120.0, description="[s] at most, of teaching")
    goal: Goal = Field(default_factory=lambda: Goal(offset=(0.0, 0.0, 0.0)))
    skin: Skin = Field(default_factory=lambda: Skin.model_construct(rings=(), sensor=Sensor()))
    guard: Guard
    legs: tuple[Leg, ...] = Field(alias="leg", min_length=1, description="the wished path")
    hand: Hand = Field(default_factory=Hand)
    admittance: Admittance = Field(default_factory=Admittance)
    arm: Arm = Field(default_factory=Arm)
    playback: Playback = Field(default_factory=Playback)
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

    def slow(self) -> WalkScenario:
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
    goal: Goal = Field(default_factory=lambda: Goal(offset=(0.0, 0.0, 0.0)))
    legs: tuple[Leg, ...] = Field(alias="leg", min_length=1, description="the wished path")
    hand: Hand = Field(default_factory=Hand)
    admittance: Admittance = Field(default_factory=Admittance)


_SLOW_SHARE = 0.9  # of the bound that an operator dares: as 1.17 m/s of 1.30

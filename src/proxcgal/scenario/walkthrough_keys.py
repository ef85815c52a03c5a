"""The keys of a walk-through: `[guard]`, `[[leg]]`, `[hand]`, `[admittance]`, `[playback]`, ..."""

from pydantic import Field

from proxcgal.core.schema import NonNegative, Positive, Section, Share, Vector, core_table


class HumanKeys(core_table("OperatorCapsule")):
    """The operator's capsule, which rides on the tool and stands upright."""


class IsoKeys(
    core_table(
        "IsoSeparation",
        intrusion={"ge": 0},
        human_uncertainty={"ge": 0},
        robot_uncertainty={"ge": 0},
    )
):
    """What the separation distance of ISO/TS 15066 is computed with, beside the threshold."""


class GuardKeys(
    core_table(
        "GuardConfig",
        only=(
            "tcp_speed",
            "stop_time",
            "rest_speed",
            "max_gap",
            "min_distance",
            "max_velocity",
            "q_reference",
            "pairs",
            "ends",
            "subtract_human",
            "accept",
        ),
    )
):
    """The guard: [WT] section 3."""

    human: HumanKeys = Field(default_factory=HumanKeys)
    iso: IsoKeys = Field(default_factory=IsoKeys)


class AdmittanceKeys(core_table("AdmittanceConfig")):
    """M a + D v = F: three linear and three angular axes, in the base frame."""


class HandKeys(Section):
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


class LegKeys(Section):
    """One leg of the wished path, from rest to rest."""

    to: Vector = Field((0.0, 0.0, 0.0), description="[m] from where the tool starts, base axes")
    turn: Vector = Field(
        (0.0, 0.0, 0.0), description="[rad] rotation vector from where it starts, base axes"
    )
    speed: Positive = Field(description="[m/s] at most")
    turn_speed: Positive = Field(1.0, description="[rad/s] at most")
    ramp: Positive = Field(0.8, description="[s] from rest to full speed, and back")
    wait: NonNegative = Field(0.1, description="[s] at its end")


class PlaybackKeys(Section):
    """How what was taught is cleaned and run."""

    tolerance: Positive = Field(0.001, description="[m] smoothing moves the tool by at most this")
    step: Positive = Field(0.004, description="[s] between samples of the cleaned path")
    scale: Positive = Field(1.0, description="of the recorded timing: 2 takes twice as long")
    margin: Share = Field(0.95, description="of the guard's bounds that timing may use")
    start_tolerance: Positive = Field(0.005, description="[m] of the tool from the path's start")
    approach_speed: Positive = Field(
        0.25, description="[m/s] of the tool on its way there, at most"
    )


class ArmKeys(Section):
    """What the simulated arm is like, and what it is allowed."""

    payload: NonNegative = Field(0.0, description="[kg] more, at the tool")
    brake_scale: Positive = Field(1.0, description="of the brakes' torques")
    command_share: Share = Field(
        0.7, description="of the guard's acceleration bounds that commands may use"
    )

"""The keys of a walk-through: `[guard]`, `[[leg]]`, `[hand]`, `[admittance]`, `[playback]`, ..."""

from typing import Annotated

from pydantic import Field

from proxcgal.core.schema import NonNegative, Positive, Section, Share, Vector, like

Vector6 = Annotated[tuple[float, ...], Field(min_length=6, max_length=6)]


class HumanKeys(Section):
    """The operator's capsule, which rides on the tool and stands upright."""

    radius: Positive = Field(0.200, description="[m] opRad")
    height: Positive = Field(1.80, description="[m] opH, rounding included")
    offset: Vector = Field(
        (0.0, 0.0, 0.25), description="[m] opRelP, of its middle in the tool's frame"
    )


class IsoKeys(Section):
    """What the separation distance of ISO/TS 15066 is computed with, beside the threshold."""

    human_speed: NonNegative = Field(1.6, description="[m/s] v_h")
    reaction_time: NonNegative = Field(1.0 / 15.0, description="[s] T_r, one frame of a sensor")
    intrusion: NonNegative = Field(0.0, description="[m] C")
    human_uncertainty: NonNegative = Field(0.0, description="[m] Z_d")
    robot_uncertainty: NonNegative = Field(0.0, description="[m] Z_r")


class GuardKeys(Section):
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
    human: HumanKeys = Field(default_factory=HumanKeys)
    iso: IsoKeys = Field(default_factory=IsoKeys)


class AdmittanceKeys(Section):
    """M a + D v = F: three linear and three angular axes, in the base frame."""

    mass: Vector6 = like("AdmittanceConfig", "mass", "[kg], [kg m^2] M")
    damping: Vector6 = like("AdmittanceConfig", "damping", "[N s/m], [N m s/rad] D")
    dead_band: Vector6 = like("AdmittanceConfig", "dead_band", "[N], [N m]")
    max_force: Vector6 = like("AdmittanceConfig", "max_force", "[N], [N m]")
    engage_time: NonNegative = like(
        "AdmittanceConfig", "engage_time", "[s] in which the hand is let in, and let go"
    )


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

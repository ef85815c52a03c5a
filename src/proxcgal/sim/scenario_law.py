"""The keys of a scenario's `[controller]`: tasks, filter, solver, monitor."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from proxcgal.sim.scenario_keys import (
    Bound,
    Count,
    NonNegative,
    Positive,
    Section,
    Share,
    like,
)

SensedController = Literal["wb", "sm", "wb_memory"]
TaskName = Literal[
    "avoidance",
    "reach",
    "reach_position",
    "reach_orientation",
    "joint_limits",
    "minimum_altitude",
    "manipulability",
]


class Filter(Section):
    """Body removal."""

    tolerance: NonNegative = like("FilterConfig", "tolerance", "[m] epsilon of Algorithm 1")
    sigmas: NonNegative = like(
        "FilterConfig", "sigmas", "the tolerance is at least this many sigma(range)"
    )
    min_hit: NonNegative = like(
        "FilterConfig", "min_hit", "[m] nearer hits are the sensor's own mounting"
    )
    surface_margin: bool = like(
        "FilterConfig", "surface_margin", "also drop what lies that near to any link"
    )
    confirmation: Literal["off", "zones", "scans"] = like(
        "FilterConfig", "confirmation", "believe a point only when seen twice"
    )
    z_min: Bound = like("FilterConfig", "z_min", "[m] points below are cropped (floor)")


class Solver(Section):
    """The task-priority solver."""

    damping: NonNegative = like("SolverConfig", "damping", "lambda")
    damping_threshold: Positive = like(
        "SolverConfig",
        "damping_threshold",
        "s_th; eigenvalues of X'AX below are damped: singular values below its square root",
    )
    eta: NonNegative = like("SolverConfig", "eta", "cost of leaving the upper levels' freedom")
    form: Literal["literal", "code"] = like("SolverConfig", "form", "of the damped inverse")


class Monitor(Section):
    """Bounds of the monitor."""

    degraded_after: Positive = like(
        "MonitorConfig", "degraded_after", "[s] age of one sensor's scan that slows the arm"
    )
    hold_after: Positive = like(
        "MonitorConfig", "hold_after", "[s] age of an array's scans that holds the arm"
    )
    degraded_scale: Share = like(
        "MonitorConfig", "degraded_scale", "of the speed limits while degraded"
    )
    clean_cycles: Count = like(
        "MonitorConfig", "clean_cycles", "cycles without a cause before a mode clears"
    )
    missed_deadlines: Count = like(
        "MonitorConfig", "missed_deadlines", "in a row, before the arm holds"
    )
    suspect_repeats: int = like(
        "MonitorConfig",
        "suspect_repeats",
        "equal payloads in a row that make a sensor suspect; 0 for never (sensors without noise)",
        ge=0,
    )
    fresh_within: Positive = like(
        "MonitorConfig", "fresh_within", "[s] a scan of this age is trusted as it is"
    )
    approach_speed: NonNegative = like(
        "MonitorConfig",
        "approach_speed",
        "[m/s] assumed of what moves in: past `fresh_within` it shortens the trusted distance",
    )
    blind_speed: NonNegative = like(
        "MonitorConfig",
        "blind_speed",
        "[m/s] at most into what a silent sensor covered; 0 at `hold_after`",
    )
    joints_hold_after: Positive = like(
        "MonitorConfig", "joints_hold_after", "[s] age of the joint state that holds the arm"
    )
    joints_stop_after: Positive = like(
        "MonitorConfig", "joints_stop_after", "[s] age of the joint state that stops it"
    )
    stuck_after: Positive = like(
        "MonitorConfig", "stuck_after", "[s] of avoidance not executed inside d_min, before HOLD"
    )


class Memory(Section):
    """What `wb_memory` remembers."""

    memory_s: NonNegative = like(
        "MemoryConfig", "memory_s", "[s] age at which a point is forgotten in any case; 0: none"
    )
    voxel: Positive = like("MemoryConfig", "voxel", "[m] edge; each holds one point, the newest")
    max_points: Count = like(
        "MemoryConfig", "max_points", "beyond, those farthest from the arm are forgotten"
    )
    clear_scans: Count = like(
        "MemoryConfig", "clear_scans", "that must see through a point before it counts as gone"
    )


class Motion(Section):
    """x_o of [WA] eq. (4), from the scans."""

    controllers: tuple[SensedController, ...] = Field(
        ("wb_memory",), description="of wb, sm, wb_memory: those that use it"
    )
    window: Positive = like("MotionConfig", "window", "[s] scans that old count")
    radius: Positive = like(
        "MotionConfig", "radius", "[m] of the patch of surface round the closest point"
    )
    confidence: NonNegative = like(
        "MotionConfig", "confidence", "standard deviations below which a velocity counts as none"
    )
    max_speed: NonNegative = like(
        "MotionConfig", "max_speed", "[m/s] the estimate is shortened to it"
    )


class JointLimits(Section):
    """Task `joint_limits`."""

    gain: Positive = like("JointLimits", "gain", "[1/s] towards the middle")
    margin: Positive = like("JointLimits", "margin", "[rad] or [m] where it begins to act")


class MinimumAltitude(Section):
    """Task `minimum_altitude`."""

    height: float = like("MinimumAltitude", "height", "[m] the tool is to stay above")
    buffer: Positive = like("MinimumAltitude", "buffer", "[m] above it, where it begins to act")
    gain: Positive = like("MinimumAltitude", "gain", "[1/s]")


class Manipulability(Section):
    """Task `manipulability`."""

    target: Positive = like("Manipulability", "target", "the rate pulls towards it")
    low: Positive = like("Manipulability", "low", "fully active below")
    high: Positive = like("Manipulability", "high", "inactive above")
    gain: Positive = like("Manipulability", "gain", "[1/s]")
    first_joint: int = like(
        "Manipulability", "first_joint", "of the arm that is meant, from 0", ge=0
    )
    joints: int = like("Manipulability", "joints", "of that arm; 0: all from the first on", ge=0)

    @model_validator(mode="after")
    def _low_below_high(self) -> Self:
        if self.low >= self.high:
            raise ValueError(f"low is {self.low} and high {self.high}: low must be below high")
        return self


class Controller(Section):
    """The control law, the same for the whole body and for the sensor points."""

    d_min: Positive = like("Avoidance", "d_min", "[m] distance to keep")
    buffer: Positive = like("Avoidance", "buffer", "[m] Delta: avoidance fades in over it")
    avoid_gain: Positive = like("Avoidance", "gain", "[1/s] lambda of avoidance")
    nearest: Count = like("Avoidance", "nearest", "this many nearest links, one row each", le=32)
    reach_gain: Positive = like("Reach", "gain", "[1/s] lambda of reaching")
    max_linear: Positive = like("Reach", "max_linear", "[m/s] of reaching")
    max_angular: Positive = like("Reach", "max_angular", "[rad/s] of reaching")
    tasks: tuple[TaskName, ...] = Field(
        ("avoidance", "reach"), min_length=1, description="their order is their priority"
    )
    min_row_norm: NonNegative = like(
        "ControllerConfig",
        "min_row_norm",
        "a link that joints move less than this is passed over",
        lt=1,
    )
    avoid_links: tuple[str, ...] = like(
        "ControllerConfig", "avoid_links", "links to keep away; empty: all that some joint moves"
    )
    method: Literal["fast", "paper"] = like(
        "ControllerConfig", "method", "accelerated or literal, with the same answer"
    )
    filter: Filter = Field(default_factory=Filter)
    solver: Solver = Field(default_factory=Solver)
    monitor: Monitor = Field(default_factory=Monitor)
    memory: Memory = Field(default_factory=Memory)
    motion: Motion = Field(default_factory=Motion)
    joint_limits: JointLimits = Field(default_factory=JointLimits)
    minimum_altitude: MinimumAltitude = Field(default_factory=MinimumAltitude)
    manipulability: Manipulability = Field(default_factory=Manipulability)

    @model_validator(mode="after")
    def _each_task_once(self) -> Self:
        if len(set(self.tasks)) < len(self.tasks):
            raise ValueError("tasks names one of them twice")
        return self

"""The keys of a scenario's `[controller]`: tasks, filter, solver, monitor."""

from typing import Literal, Self

from pydantic import Field, model_validator

from proxcgal.core.schema import Bound, Count, NonNegative, Positive, Section, Share, like

SensedController = Literal["wb", "sm", "wb_memory"]
TaskName = Literal[
    "avoidance",
    "reach",
    "reach_position",
    "reach_orientation",
    "joint_limits",
    "minimum_altitude",
    "manipulability",
    "manipulability_macro",
    "manipulability_micro",
    "self_collision",
    "thesis",
    "full",
]
#: Names that stand for several tasks. `thesis` is what [JR] 4.2.1 names; `full` adds the joint
#: limits of its author's code.
STACKS: dict[str, tuple[TaskName, ...]] = {
    "thesis": ("minimum_altitude", "avoidance", "reach"),
    "full": ("joint_limits", "avoidance", "minimum_altitude", "reach"),
}


class FilterKeys(Section):
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


class SolverKeys(Section):
    """The task-priority solver."""

    damping: NonNegative = like("SolverConfig", "damping", "lambda")
    damping_threshold: Positive = like(
        "SolverConfig",
        "damping_threshold",
        "s_th; eigenvalues of X'AX below are damped: singular values below its square root",
    )
    eta: NonNegative = like("SolverConfig", "eta", "cost of leaving the upper levels' freedom")
    form: Literal["literal", "code"] = like("SolverConfig", "form", "of the damped inverse")


class MonitorKeys(Section):
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


class MemoryKeys(Section):
    """What `wb_memory` remembers."""

    memory_s: NonNegative = like(
        "MemoryConfig", "memory_s", "[s] age at which a point is forgotten in any case; 0: none"
    )
    voxel: Positive = like(
        "MemoryConfig", "voxel", "[m] edge; each holds one point, the newest", ge=0.005, le=0.5
    )
    max_points: int = like(
        "MemoryConfig",
        "max_points",
        "beyond, the farthest from the arm are forgotten",
        ge=3,
        le=65536,
    )
    clear_scans: Count = like(
        "MemoryConfig",
        "clear_scans",
        "that must see through a point before it counts as gone",
        le=100,
    )


class MotionKeys(Section):
    """x_o of [WA] eq. (4), from the scans."""

    controllers: tuple[SensedController, ...] = Field(
        ("wb_memory",), description="of wb, sm, wb_memory: those that use it"
    )
    window: Positive = like("MotionConfig", "window", "[s] scans that old count", le=1)
    radius: Positive = like(
        "MotionConfig", "radius", "[m] of the patch of surface round the closest point", le=1
    )
    confidence: NonNegative = like(
        "MotionConfig", "confidence", "standard deviations below which a velocity counts as none"
    )
    max_speed: NonNegative = like(
        "MotionConfig", "max_speed", "[m/s] the estimate is shortened to it"
    )


class JointLimitsKeys(Section):
    """Task `joint_limits`."""

    gain: Positive = like("JointLimits", "gain", "[1/s] towards the middle")
    margin: Positive = like("JointLimits", "margin", "[rad] or [m] where it begins to act")


class MinimumAltitudeKeys(Section):
    """Task `minimum_altitude`."""

    height: float = like("MinimumAltitude", "height", "[m] the tool is to stay above")
    buffer: Positive = like("MinimumAltitude", "buffer", "[m] above it, where it begins to act")
    gain: Positive = like("MinimumAltitude", "gain", "[1/s]")


class ManipulabilityKeys(Section):
    """Task `manipulability`."""

    target: Positive = like("Manipulability", "target", "the rate pulls towards it")
    low: Positive = like("Manipulability", "low", "fully active below")
    high: Positive = like("Manipulability", "high", "inactive above")
    gain: Positive = like("Manipulability", "gain", "[1/s]")
    first_joint: int = like(
        "Manipulability", "first_joint", "of the arm that is meant, from 0", ge=0
    )
    joints: int = like("Manipulability", "joints", "of that arm; 0: all from the first on", ge=0)
    unit: Positive = like("Manipulability", "unit", "it is counted in this: 1, or the maximum")

    @model_validator(mode="after")
    def _low_below_high(self) -> Self:
        if self.low >= self.high:
            raise ValueError(f"low is {self.low} and high {self.high}: low must be below high")
        return self


class ArmManipulabilityKeys(Section):
    """Tasks `manipulability_macro` and `manipulability_micro`: one arm of two, normalised.

    The arm's manipulability counts as a share of the largest that 4000 random postures of the
    whole robot have.
    """

    target: Positive = like("Manipulability", "target", "the rate pulls towards it")
    low: Positive = like("Manipulability", "low", "fully active below")
    high: Positive = like("Manipulability", "high", "inactive above")
    gain: Positive = like("Manipulability", "gain", "[1/s]")


class SelfCollisionKeys(Section):
    """Task `self_collision`: links that joints beyond the first arm move, against all others."""

    d_min: NonNegative = like("SelfCollision", "d_min", "[m] distance to keep")
    buffer: Positive = like("SelfCollision", "buffer", "[m] above it, where it begins to act")
    gain: Positive = like("SelfCollision", "gain", "[1/s]")
    nearest: Count = like("SelfCollision", "nearest", "this many nearest pairs of links", le=32)


class ControllerKeys(Section):
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
    off: tuple[TaskName, ...] = Field((), description="tasks of `tasks` that are left out")
    macro_joints: int = Field(
        0,
        ge=0,
        description="so many first joints are those of an arm that carries another; 0: none",
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
    filter: FilterKeys = Field(default_factory=FilterKeys)
    solver: SolverKeys = Field(default_factory=SolverKeys)
    monitor: MonitorKeys = Field(default_factory=MonitorKeys)
    memory: MemoryKeys = Field(default_factory=MemoryKeys)
    motion: MotionKeys = Field(default_factory=MotionKeys)
    joint_limits: JointLimitsKeys = Field(default_factory=JointLimitsKeys)
    minimum_altitude: MinimumAltitudeKeys = Field(default_factory=MinimumAltitudeKeys)
    manipulability: ManipulabilityKeys = Field(default_factory=ManipulabilityKeys)

    arm_manipulability: ArmManipulabilityKeys = Field(default_factory=ArmManipulabilityKeys)
    self_collision: SelfCollisionKeys = Field(default_factory=SelfCollisionKeys)

    @property
    def levels(self) -> tuple[TaskName, ...]:
        """The tasks that run, in their order: named stacks spelled out, those that are off left."""
        return tuple(name for name in self._spelled_out() if name not in self.off)

    def _spelled_out(self) -> list[TaskName]:
        return [task for name in self.tasks for task in STACKS.get(name, (name,))]

    @model_validator(mode="after")
    def _each_task_once(self) -> Self:
        named = self._spelled_out()
        if len(set(named)) < len(named):
            raise ValueError("tasks names one of them twice")
        if unknown := [name for name in self.off if name not in named]:
            raise ValueError(
                f"off names {', '.join(unknown)}, but the tasks are {', '.join(named)}"
            )
        if not self.levels:
            raise ValueError("off leaves no task")
        if not self.macro_joints and (
            two := [name for name in named if name.endswith(("_macro", "_micro"))]
        ):
            raise ValueError(f"{', '.join(two)} needs macro_joints: which joints the first arm has")
        return self

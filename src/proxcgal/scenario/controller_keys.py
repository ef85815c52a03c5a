"""The keys of a scenario's `[controller]`: tasks, filter, solver, monitor."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from proxcgal.core.schema import Positive, Section, core_choice, core_key, core_table

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


class FilterKeys(core_table("FilterConfig")):
    """Body removal."""


class LimitKeys(core_table("LimitConfig", omit=("distances",))):
    """The stage after the solver."""


class SolverKeys(core_table("SolverConfig")):
    """The task-priority solver."""


class MonitorKeys(core_table("MonitorConfig", omit=("await_mounts",))):
    """Bounds of the monitor."""


class MemoryKeys(core_table("MemoryConfig")):
    """What `wb_memory` remembers."""


class MotionKeys(Section):
    """x_o of [WA] eq. (4), from the scans."""

    controllers: tuple[SensedController, ...] = Field(
        ("wb_memory",), description="of wb, sm, wb_memory: those that use it"
    )
    window: float = core_key("MotionConfig", "window")
    radius: float = core_key("MotionConfig", "radius")
    confidence: float = core_key("MotionConfig", "confidence")
    max_speed: float = core_key("MotionConfig", "max_speed")


class JointLimitsKeys(core_table("JointLimits")):
    """Task `joint_limits`."""


class MinimumAltitudeKeys(core_table("MinimumAltitude")):
    """Task `minimum_altitude`."""


class ManipulabilityKeys(core_table("Manipulability", low={"gt": 0})):
    """Task `manipulability`."""

    @model_validator(mode="after")
    def _low_below_high(self) -> Self:
        if self.low >= self.high:
            raise ValueError(f"low is {self.low} and high {self.high}: low must be below high")
        return self


class ArmManipulabilityKeys(
    core_table("Manipulability", only=("target", "low", "high", "gain"), low={"gt": 0})
):
    """Tasks `manipulability_macro` and `manipulability_micro`: one arm of two, normalised.

    The arm's manipulability counts as a share of the largest that 4000 random postures of the
    whole robot have.
    """


class SelfCollisionKeys(core_table("SelfCollision", omit=("pairs",))):
    """Task `self_collision`: links that joints beyond the first arm move, against all others."""


class ControllerKeys(Section):
    """The control law, the same for the whole body and for the sensor points."""

    d_min: Positive = core_key("Avoidance", "d_min")
    buffer: float = core_key("Avoidance", "buffer")
    avoid_gain: float = core_key("Avoidance", "gain")
    nearest: int = core_key("Avoidance", "nearest")
    reach_gain: float = core_key("Reach", "gain")
    max_linear: float = core_key("Reach", "max_linear")
    max_angular: float = core_key("Reach", "max_angular")
    tasks: tuple[TaskName, ...] = Field(
        ("avoidance", "reach"), min_length=1, description="their order is their priority"
    )
    off: tuple[TaskName, ...] = Field((), description="tasks of `tasks` that are left out")
    macro_joints: int = Field(
        0,
        ge=0,
        description="so many first joints are those of an arm that carries another; 0: none",
    )
    min_row_norm: float = core_key("ControllerConfig", "min_row_norm")
    avoid_links: tuple[str, ...] = core_key("ControllerConfig", "avoid_links")
    method: Annotated[str, core_choice("ControllerConfig", "method")] = core_key(
        "ControllerConfig", "method"
    )
    limit: Literal["full", "papers"] = Field(
        "full",
        description="full: approach caps and retreat after the solver; papers: the joints' limits "
        "only",
    )
    limit_settings: LimitKeys = Field(default_factory=LimitKeys)
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

"""A scenario file: its top-level keys, `[limits]`, and what all kinds of scenario have."""

from typing import Literal

from pydantic import Field

from proxcgal.core import toml
from proxcgal.core.schema import Positive, Section
from proxcgal.scenario.controller_keys import ControllerKeys
from proxcgal.scenario.fault_keys import Fault
from proxcgal.scenario.goal_keys import FinishKeys, GoalKeys
from proxcgal.scenario.simulation_keys import SimulationKeys
from proxcgal.scenario.skin_keys import SkinKeys
from proxcgal.scene.obstacle_keys import Obstacle
from proxcgal.scene.obstacles import ObstacleScene, Scene

#: wb: whole body; sm: sensor points; wb_known: whole body on points of the scene itself; wb_memory:
#: whole body that remembers what left the sensors' view.
CONTROLLERS = ("wb", "sm", "wb_known", "wb_memory")
#: Those that run where nobody chooses: the paper's, and their ceiling.
USUAL = ("wb", "sm", "wb_known")

LONGEST = 1e5  #: [s] that a scene may last


class LimitsKeys(Section):
    """Limits of a user's own robot, where its description has none; one number is for all."""

    speed: Positive | tuple[Positive, ...] | None = Field(None, description="[rad/s] or [m/s]")
    acceleration: Positive | tuple[Positive, ...] | None = Field(
        None, description="[rad/s^2] or [m/s^2]"
    )


class Scenario(Section):
    """A scene, a robot with its sensors, and what it is to do."""

    name: str = Field("unnamed", description="left out in a file: the file's own name")
    description: str = Field("", description="one line, shown in lists")
    kind: Literal["static", "hri", "joint", "walkthrough", "guided"] = Field(
        description="what kind of scene this is"
    )
    robot: str = Field(description="a built-in robot's name, or a path to .urdf, .xacro or .xml")
    package_dirs: tuple[str, ...] = Field(
        (), description="where package:// paths of the robot's file are looked up"
    )
    xacro_args: tuple[str, ...] = Field((), description="name=value, arguments of a .xacro robot")
    tool: str | None = Field(
        None, description="name of the robot's tool frame, where its file leaves that open"
    )
    vertices_per_link: int = Field(
        1000, ge=0, description="of the controller's meshes, 0: as they are; the simulator's are"
    )
    q0: tuple[float, ...] = Field(min_length=1, description="[rad] or [m] joint positions at 0 s")
    duration: Positive = Field(le=LONGEST, description="[s] at most 100000")
    perception: Literal["sensed", "known"] = Field(
        "sensed", description="what the controller gets: scans, or points of the scene itself"
    )
    seed: int = Field(0, ge=0, lt=2**63, description="fixes every random draw")
    goal: GoalKeys
    limits: LimitsKeys = Field(default_factory=LimitsKeys)
    skin: SkinKeys
    controller: ControllerKeys = Field(default_factory=ControllerKeys)
    simulation: SimulationKeys = Field(default_factory=SimulationKeys)
    obstacles: tuple[Obstacle, ...] = Field((), alias="obstacle")
    faults: tuple[Fault, ...] = Field((), alias="fault")

    def scene(self) -> Scene:
        """What stands and moves beside the robot and can be sensed."""
        return ObstacleScene([obstacle for obstacle in self.obstacles if obstacle.sensed])

    def measured(self) -> Scene:
        """What true distances run to."""
        return self.scene()

    def drawn(self) -> Scene:
        """All that is there."""
        return ObstacleScene(self.obstacles)

    def start(self) -> tuple[str, tuple[float, ...]]:
        """Joint positions at 0 s, and the key that gives them."""
        return "q0", self.q0

    def controllers(self) -> tuple[str, ...]:
        """Those of a run that names none."""
        return USUAL

    def ends(self) -> FinishKeys | None:
        """When a run is over before its time; None: never."""
        return None

    @property
    def floor(self) -> float:
        """Height of the floor in pictures [m]; sensors see none."""
        return 0.0

    def to_toml(self) -> str:
        """The file that gives this scenario again, with every default written out."""
        return toml.write(self.model_dump(by_alias=True))

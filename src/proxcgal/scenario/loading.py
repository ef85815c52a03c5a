"""Scenario files: one TOML file says what is simulated; every problem in it is told at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field, ValidationError

from proxcgal.core import toml
from proxcgal.core.errors import ConfigError
from proxcgal.models.formats.paths import is_robot_file
from proxcgal.scenario.controller import Controller
from proxcgal.scenario.keys import (
    Fault,
    Goal,
    Limits,
    Obstacle,
    Positive,
    Section,
    Simulation,
    Skin,
)
from proxcgal.scenario.problems import lines
from proxcgal.scene.human.operator import Operator
from proxcgal.scene.human.person import Person, person_of
from proxcgal.scene.obstacles import ObstacleScene, Scene, Together

if TYPE_CHECKING:
    from proxcgal.scenario.joint import Finish

#: wb: whole body; sm: sensor points; wb_known: whole body on points of the scene itself; wb_memory:
#: whole body that remembers what left the sensors' view.
CONTROLLERS = ("wb", "sm", "wb_known", "wb_memory")
#: Those that run where nobody chooses: the paper's, and their ceiling.
USUAL = ("wb", "sm", "wb_known")

LONGEST = 1e5  #: [s] that a scene may last


class Scenario(Section):
    """A scene, a robot with its sensors, and what it is to do."""

    name: str = Field("unnamed", description="left out in a file: the file's own name")
    description: str = Field("", description="one line, shown in lists")
    kind: Literal["static", "hri", "joint", "walkthrough", "guided"] = Field(
        description="what kind of scene this is"
    )
    robot: str = Field(description="a built-in robot's name, or a path to .urdf or .xml")
    package_dirs: tuple[str, ...] = Field(
        (), description="where package:// paths of the robot's file are looked up"
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
    goal: Goal
    limits: Limits = Field(default_factory=Limits)
    skin: Skin
    controller: Controller = Field(default_factory=Controller)
    simulation: Simulation = Field(default_factory=Simulation)
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

    def ends(self) -> Finish | None:
        """When a run is over before its time; None: never."""
        return None

    @property
    def floor(self) -> float:
        """Height of the floor in pictures [m]; sensors see none."""
        return 0.0

    def to_toml(self) -> str:
        """The file that gives this scenario again, with every default written out."""
        return toml.write(self.model_dump(by_alias=True))


class HriScenario(Scenario):
    """A person walks in and works beside the arm; distances run to that person alone."""

    operator: Operator

    def person(self) -> Person:
        """Who works there.

        Raises:
            ConfigError: a recording that cannot be read; a place out of reach, or not in time.
        """
        return person_of(self.operator, self.duration)

    def scene(self) -> Scene:
        """The person, and what else can be sensed."""
        return Together(self.person(), super().scene())

    def measured(self) -> Scene:
        """The person."""
        return self.person()

    def drawn(self) -> Scene:
        """The person, and all that stands round."""
        return Together(self.person(), super().drawn())

    @property
    def floor(self) -> float:
        """Height of the floor that the person stands on [m]; sensors see none."""
        return self.operator.floor

    def signals(self) -> list[tuple[float, str]]:
        """Time [s] and note of every signal of the timeline; none that a recording heeds."""
        if self.operator.recording is not None:
            return []
        return [(step.at, step.note) for step in self.operator.timeline]

    @property
    def on_the_left(self) -> bool:
        """Does the person work on the arm's left?"""
        step = self.operator.timeline[0]
        return self.operator.marks[step.mark][1] > 0.0

    def windows(self) -> dict[str, tuple[float, float]]:
        """Start and end of every phase that is reported, by name [s]."""
        steps = self.operator.timeline
        ends = [*(step.at for step in steps[1:]), self.duration]
        return {
            step.phase: (step.at, end)
            for step, end in zip(steps, ends, strict=True)
            if step.phase is not None
        }


def kinds() -> dict[str, type[Scenario]]:
    """The class of each `kind`."""
    from proxcgal.scenario.joint import JointScenario  # made from Scenario, as those below
    from proxcgal.scenario.walkthrough import GuidedScenario, WalkScenario

    return {
        "static": Scenario, "hri": HriScenario, "joint": JointScenario,
        "walkthrough": WalkScenario, "guided": GuidedScenario,
    }  # fmt: skip


def list_scenarios() -> dict[str, str]:
    """Names of the built-in scenarios, with a line on each."""
    listed = {}
    for path in _built_in():
        table = toml.parse(path.read_text(encoding="utf-8"), path.name)
        listed[path.stem] = str(table.get("description", ""))
    return listed


def load_scenario(name_or_path: str | Path, overrides: Sequence[str] = ()) -> Scenario:
    """Reads a built-in scenario by name, or a file.

    Args:
        name_or_path: a name of `list_scenarios`, or a path to a TOML file.
        overrides: `key.sub=value`, applied in order after the file.

    Raises:
        ConfigError: all that is wrong, one line each: file, key, value, what is allowed.
    """
    built_in = {path.stem: path for path in _built_in()}
    path = built_in.get(str(name_or_path), Path(name_or_path))
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not a text file"
        if isinstance(error, IsADirectoryError):
            reason = "a folder" if str(name_or_path) else "no name"
        if isinstance(error, FileNotFoundError):
            reason = "no built-in scenario has that name, and no file"
        raise ConfigError(
            f"scenario {str(name_or_path)!r}: {reason}; a path to a TOML file or one of: "
            f"{', '.join(sorted(built_in))}"
        ) from None
    origin = path.name if str(name_or_path) in built_in else str(path)
    table = toml.parse(text, origin)
    table.setdefault("name", path.stem)
    _anchor(table, path.parent)
    return _checked(table, origin, overrides)


def parse_scenario(text: str, origin: str, overrides: Sequence[str] = ()) -> Scenario:
    """The scenario of a TOML text, such as a recording carries. Raises: as `load_scenario`."""
    return _checked(toml.parse(text, origin), origin, overrides)


def change_scenario(scenario: Scenario, origin: str, overrides: Sequence[str]) -> Scenario:
    """A scenario with some keys changed. Raises: as `load_scenario`."""
    return parse_scenario(scenario.to_toml(), origin, overrides) if overrides else scenario


def _checked(table: dict[str, Any], origin: str, overrides: Sequence[str]) -> Scenario:
    keys = [toml.override(table, assignment) for assignment in overrides]
    kind = table.get("kind", "static")
    model = kinds().get(kind, Scenario) if isinstance(kind, str) else Scenario
    try:
        return model.model_validate(_tuples(table))
    except ValidationError as error:
        raise ConfigError("\n".join(lines(model, error, origin, keys))) from None


def _built_in() -> list[Path]:
    folder = Path(str(resources.files("proxcgal.scenario"))) / "builtin"
    return sorted(folder.glob("*.toml"))


def _anchor(table: dict[str, Any], folder: Path) -> None:
    """Paths in a file are relative to that file, wherever it is read from."""
    robot = table.get("robot")
    if isinstance(robot, str) and is_robot_file(robot):
        table["robot"] = str((folder / robot).absolute())
    ratings = table.get("ratings")
    if isinstance(ratings, str):
        table["ratings"] = str((folder / ratings).absolute())
    operator = table.get("operator")
    if isinstance(operator, dict) and isinstance(operator.get("recording"), str):
        operator["recording"] = str((folder / operator["recording"]).absolute())
    places = table.get("package_dirs")
    if isinstance(places, list) and all(isinstance(place, str) for place in places):
        table["package_dirs"] = [str((folder / place).absolute()) for place in places]


def _tuples(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _tuples(item) for key, item in value.items()}
    return tuple(_tuples(item) for item in value) if isinstance(value, list | tuple) else value

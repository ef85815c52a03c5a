"""Scenario files: one TOML file says what is simulated; every problem in it is reported at once."""

from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from proxcgal.core import toml
from proxcgal.core.errors import ConfigError
from proxcgal.models.formats.paths import is_robot_file
from proxcgal.scenario.hri_scenario import HriScenario
from proxcgal.scenario.joint_scenario import JointScenario
from proxcgal.scenario.overrides import override
from proxcgal.scenario.problems import lines
from proxcgal.scenario.scenario import Scenario
from proxcgal.scenario.walkthrough_scenario import GuidedScenario, WalkScenario

#: The class of each `kind`.
KINDS: dict[str, type[Scenario]] = {
    "static": Scenario,
    "hri": HriScenario,
    "joint": JointScenario,
    "walkthrough": WalkScenario,
    "guided": GuidedScenario,
}


def list_scenarios() -> dict[str, str]:
    """Names of the built-in scenarios, with a line on each."""
    tables = {
        path.stem: toml.parse(path.read_text(encoding="utf-8"), path.name) for path in _built_in()
    }
    return {name: str(table.get("description", "")) for name, table in tables.items()}


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
    keys = [override(table, assignment) for assignment in overrides]
    kind = table.get("kind", "static")
    model = KINDS.get(kind, Scenario) if isinstance(kind, str) else Scenario
    try:
        return model.model_validate(_tuples(table))
    except ValidationError as error:
        raise ConfigError("\n".join(lines(model, error, origin, keys))) from None


def _built_in() -> list[Path]:
    return sorted(Path(str(resources.files("proxcgal.scenario"))).glob("builtin/*.toml"))


def _anchor(table: dict[str, Any], folder: Path) -> None:
    """Paths in a file are relative to that file, wherever it is read from."""

    def anchored(place: str) -> str:
        return str((folder / place).absolute())

    for owner, key in ((table, "robot"), (table, "ratings"), (table.get("operator"), "recording")):
        if (
            isinstance(owner, dict)
            and isinstance(place := owner.get(key), str)
            and (key != "robot" or is_robot_file(place))
        ):
            owner[key] = anchored(place)
    places = table.get("package_dirs")
    if isinstance(places, list) and all(isinstance(place, str) for place in places):
        table["package_dirs"] = [anchored(place) for place in places]


def _tuples(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _tuples(item) for key, item in value.items()}
    return tuple(_tuples(item) for item in value) if isinstance(value, list | tuple) else value

"""A folder of results, read back and checked: files may be old, cut, or another program's."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from proxcgal.core.errors import ConfigError

SUMMARY, ORIGIN = "summary.json", "run.json"


class _Stored(BaseModel):
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)


class StoredNumbers(_Stored):
    """Numbers of one controller, as `static_summary` has them."""

    true_min_m: float | None = None
    true_final_m: float | None = None
    seen_min_m: float | None = None
    goal_error_m: float | None = None
    violations: int | None = None
    self_min_m: float | None = None
    mean_m: dict[str, dict[str, float | None]] = {}  # beside a person: by phase, true and seen


class StoredSummary(_Stored):
    """`summary.json` of one scenario."""

    scenario: str
    robot: str
    seed: int
    recording: str | None = None  # of the person beside the arm, where none was drawn
    controllers: dict[str, StoredNumbers]
    closest_points: dict[str, dict[str, float | None]] = {}  # shares of `sim.coverage`
    gain_mm: float | None = None
    self_min_m: float | None = None
    failed: bool = False


class StoredTrial(_Stored):
    """Timings and findings of one trial."""

    wall_s: float
    tick_median_us: float
    tick_p99_us: float
    findings: dict[str, int] = {}


class About(_Stored):
    """`run.json`: how results were made. All of it may be missing."""

    command: str | None = None
    made: str | None = None
    commit: str | None = None
    machine: str | None = None
    description: str = ""
    versions: dict[str, str] = {}
    trials: dict[str, StoredTrial] = {}


class StoredCell(_Stored):
    """One cell of the timing grid."""

    robot: str
    vertices: int
    cloud: str
    points: int
    algorithm: int
    method: str
    median_us: float
    p99_us: float
    max_us: float


class Exponent(_Stored):
    """Growth of a time, and of the paper's formula."""

    exponent: float
    low: float | None = None
    high: float | None = None
    formula: float


class StoredGrowth(_Stored):
    """Growth of one robot, algorithm and method."""

    robot: str
    algorithm: int
    method: str
    vertices: Exponent | None = None
    points: Exponent | None = None


class SweepSummary(_Stored):
    """`summary.json` of the timing grid."""

    machine: str
    cells: list[StoredCell]
    growth: list[StoredGrowth] = []


M = TypeVar("M", bound=BaseModel)
S = TypeVar("S")


@dataclass(frozen=True, slots=True)
class Stored(Generic[S]):
    """A folder of results."""

    folder: Path
    summary: S
    about: About = field(default_factory=About)
    settings: str = ""  # scenario.toml: the resolved scenario; empty where there is none


StoredRun = Stored[StoredSummary]  # one scenario's
StoredSweep = Stored[SweepSummary]  # a timing grid's
StoredResults = Stored[dict[str, Any]]  # a campaign's, joint runs', or a walk-through's


def read_results(folder: Path) -> StoredResults:
    """The results of a folder, whatever keys their summary has.

    Raises:
        ConfigError: no such folder, no summary in it, or files that cannot be read; all problems.
    """
    return Stored(folder, read_json(folder / SUMMARY), _about(folder), _settings(folder))


def read_sweep(folder: Path) -> StoredSweep:
    """The timing grid of a folder. Raises: as `read_results`."""
    about = _about(folder)
    return Stored(folder, _model(SweepSummary, folder / SUMMARY), about)


def read_runs(folder: Path) -> tuple[list[StoredRun], About]:
    """The runs of a folder, one or several scenarios', and how the whole was made.

    Raises: as `read_results`.
    """
    path = folder / SUMMARY
    content = read_json(path)
    if "scenarios" in content:
        names = content["scenarios"]
        if not isinstance(names, dict) or not names:
            raise ConfigError(f"{path}: scenarios: must be a table of summaries by name, not empty")
        runs = [_run(folder / _plain(name, path)) for name in names]
    elif "controllers" in content:
        runs = [_run(folder)]
    else:
        raise ConfigError(
            f"{path}: holds neither `scenarios` nor `controllers`: no summary of a run"
        )
    return runs, _about(folder) if (folder / ORIGIN).is_file() else runs[0].about


def _run(folder: Path) -> StoredRun:
    path = folder / SUMMARY
    return Stored(folder, _model(StoredSummary, path), _about(folder), _settings(folder))


def _about(folder: Path) -> About:
    made = folder / ORIGIN
    return _model(About, made) if made.is_file() else About()


def _settings(folder: Path) -> str:
    path = folder / "scenario.toml"
    return path.read_text(errors="replace") if path.is_file() else ""


def _plain(name: str, path: Path) -> str:
    """A sub-folder's name: a summary must not lead out of its folder."""
    if name in {"", ".", ".."} or Path(name).name != name:
        raise ConfigError(f"{path}: scenarios: {name!r} must be a plain name of a sub-folder")
    return name


def read_json(path: Path) -> dict[str, Any]:
    """A JSON object. Raises: ConfigError: no such folder or file, something else in it."""
    if not path.parent.is_dir():
        raise ConfigError(f"{path.parent}: no such folder")
    if not path.is_file():
        raise ConfigError(f"{path}: missing: no results of `proxcgal run` lie there")
    try:
        content = json.loads(path.read_bytes())
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{path}: cannot be read as JSON: {error}") from None
    if not isinstance(content, dict):
        raise ConfigError(f"{path}: must hold a JSON object, holds a {type(content).__name__}")
    return content


def _model(model: type[M], path: Path) -> M:
    try:
        return model.model_validate(read_json(path))
    except ValidationError as error:
        lines = [
            f"{path}: {'.'.join(map(str, problem['loc']))}: {problem['msg']}"
            for problem in error.errors()
        ]
        raise ConfigError("\n".join(lines)) from None

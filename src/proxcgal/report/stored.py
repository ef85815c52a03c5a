"""A folder of results, read back and checked: files may be old, cut, or another program's."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from proxcgal.core.errors import ConfigError


class _Stored(BaseModel):
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)


class Numbers(_Stored):
    """One controller's, as `static_summary` has them."""

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
    recording: str | None = None  # who was beside the arm, where nobody was drawn
    controllers: dict[str, Numbers]
    closest_points: dict[str, dict[str, float | None]] = {}  # shares of `sim.coverage`
    gain_mm: float | None = None
    self_min_m: float | None = None
    failed: bool = False


class Trial(_Stored):
    """What one trial took and found."""

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
    trials: dict[str, Trial] = {}


@dataclass(frozen=True, slots=True)
class Run:
    """What one scenario's folder holds."""

    folder: Path
    summary: StoredSummary
    about: About = field(default_factory=About)
    settings: str = ""  # scenario.toml: the resolved scenario


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
    """How a time grows, and how the paper's formula does."""

    exponent: float
    low: float | None = None
    high: float | None = None
    formula: float


class StoredGrowth(_Stored):
    """Of one robot, algorithm and method."""

    robot: str
    algorithm: int
    method: str
    vertices: Exponent | None = None
    points: Exponent | None = None


class StoredSweep(_Stored):
    """`summary.json` of the timing grid."""

    machine: str
    cells: list[StoredCell]
    growth: list[StoredGrowth] = []


@dataclass(frozen=True, slots=True)
class Sweep:
    """What a timing grid's folder holds."""

    folder: Path
    summary: StoredSweep
    about: About


@dataclass(frozen=True, slots=True)
class StoredCampaign:
    """What a campaign's folder holds, its trials apart."""

    folder: Path
    summary: dict[str, Any]  # as the kind of the campaign has it
    about: About


@dataclass(frozen=True, slots=True)
class StoredWalk:
    """What a walk-through's folder holds."""

    folder: Path
    summary: dict[str, Any]
    about: About
    settings: str  # scenario.toml


M = TypeVar("M", bound=BaseModel)


def read_walk(folder: Path) -> StoredWalk | None:
    """The walk-through of a folder; None where its summary is of something else.

    Raises:
        ConfigError: no such folder, no summary in it, or files that cannot be read; all problems.
    """
    made, settings, summary = (
        folder / "run.json", folder / "scenario.toml", _json(folder / "summary.json")
    )  # fmt: skip
    if "trips" not in summary:
        return None
    return StoredWalk(
        folder, summary, _model(About, made) if made.is_file() else About(),
        settings.read_text(errors="replace") if settings.is_file() else "",
    )  # fmt: skip


def read_campaign(folder: Path) -> StoredCampaign | None:
    """The campaign of a folder; None where its summary is of something else.

    Raises:
        ConfigError: no such folder, no summary in it, or files that cannot be read; all problems.
    """
    made, summary = folder / "run.json", _json(folder / "summary.json")
    if "campaign" not in summary:
        return None
    return StoredCampaign(folder, summary, _model(About, made) if made.is_file() else About())


def read_joint(folder: Path) -> StoredCampaign | None:
    """One scene's runs of the 12-joint robot; None where its summary is of something else.

    Raises: as `read_campaign`.
    """
    made, summary = folder / "run.json", _json(folder / "summary.json")
    if "campaign" in summary or "runs" not in summary:
        return None
    return StoredCampaign(folder, summary, _model(About, made) if made.is_file() else About())


def read_sweep(folder: Path) -> Sweep | None:
    """The timing grid of a folder; None where its summary is of something else.

    Raises:
        ConfigError: no such folder, no summary in it, or files that cannot be read; all problems.
    """
    path, made = folder / "summary.json", folder / "run.json"
    if "cells" not in _json(path):
        return None
    about = _model(About, made) if made.is_file() else About()
    return Sweep(folder, _model(StoredSweep, path), about)


def read_runs(folder: Path) -> tuple[list[Run], About]:
    """The runs of a folder, one or several scenarios', and how the whole was made.

    Raises:
        ConfigError: no such folder, no summary in it, or files that cannot be read; all problems.
    """
    path = folder / "summary.json"
    content = _json(path)
    if "scenarios" in content:
        names = content["scenarios"]
        if not isinstance(names, dict) or not names:
            raise ConfigError(f"{path}: scenarios: must be a table of summaries by name, not empty")
        runs = [read_run(folder / _plain(name, path)) for name in names]
    elif "controllers" in content:
        runs = [read_run(folder)]
    else:
        raise ConfigError(
            f"{path}: holds neither `scenarios` nor `controllers`: no summary of a run"
        )
    made = folder / "run.json"
    return runs, _model(About, made) if made.is_file() else runs[0].about


def read_run(folder: Path) -> Run:
    """One scenario's folder. Raises: as `read_runs`."""
    made, settings = folder / "run.json", folder / "scenario.toml"
    return Run(
        folder=folder,
        summary=_model(StoredSummary, folder / "summary.json"),
        about=_model(About, made) if made.is_file() else About(),
        settings=settings.read_text(errors="replace") if settings.is_file() else "",
    )


def _plain(name: str, path: Path) -> str:
    """A sub-folder's name: a summary must not lead out of its folder."""
    if name in {"", ".", ".."} or Path(name).name != name:
        raise ConfigError(f"{path}: scenarios: {name!r} must be a plain name of a sub-folder")
    return name


def _json(path: Path) -> dict[str, object]:
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
        return model.model_validate(_json(path))
    except ValidationError as error:
        lines = [
            f"{path}: {'.'.join(map(str, problem['loc']))}: {problem['msg']}"
            for problem in error.errors()
        ]
        raise ConfigError("\n".join(lines)) from None

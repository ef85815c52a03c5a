"""A folder of results: made ready, filled by trials, finished with numbers and pictures."""

from __future__ import annotations

import contextlib
import functools
import tempfile
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from proxcgal.core.errors import ConfigError
from proxcgal.core.files import write_json, write_text
from proxcgal.core.progress import ProgressBar, announce
from proxcgal.evaluation.metrics import Summary, combined, static_summary
from proxcgal.study.workers import Pool, default_workers

if TYPE_CHECKING:
    from proxcgal.evaluation.trial_log import TrialLog
    from proxcgal.models.robots import Robot
    from proxcgal.scenario.scenario import Scenario

#: What a run writes, recordings apart. Older ones are removed before a run begins: an interrupted
#: run must not leave its recordings beside another run's numbers.
FILES = (
    "summary.json",
    "run.json",
    "scenario.toml",
    "report.html",
    "distance.png",
    "pairs.png",
    "motion.gif",
    "motion.png",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Trials of one scenario, and where their results go."""

    scenario: Scenario
    controllers: tuple[str, ...]
    folder: Path


def perform(
    plans: Sequence[Plan],
    origin: dict[str, Any],
    *,
    workers: int | None = None,
    pictures: bool = True,
    quiet: bool = False,
) -> list[Summary]:
    """Runs all trials and fills the plans' folders; `check` comes first.

    Args:
        plans: what to run.
        origin: how these results are made, for `run.json`.
        workers: processes; None takes one a processor.
        pictures: draw the moving picture too.
        quiet: no progress on stderr.

    Returns:
        One summary per plan, as written to its folder.

    Raises:
        ProxError: a trial failed; recordings up to then are kept.
        KeyboardInterrupt: with a message of what was kept.
    """
    trials = [(plan, name) for plan in plans for name in plan.controllers]
    made = ready([plan.folder for plan in plans])
    try:
        with Pool(workers or default_workers(len(trials))) as pool:
            logs = _simulate(pool, trials, quiet)
            grouped = [
                [log for log, (owner, _) in zip(logs, trials, strict=True) if owner is plan]
                for plan in plans
            ]
            summaries = []
            for plan, own in zip(plans, grouped, strict=True):
                summaries.append(_summary(plan.scenario, own))
                write_text(plan.folder / "scenario.toml", plan.scenario.to_toml())
                write_json(plan.folder / "run.json", _about(plan, own, origin))
                write_json(plan.folder / "summary.json", summaries[-1])
            _draw(pool, plans, grouped, pictures, quiet)
    except KeyboardInterrupt:
        kept = [str(path) for plan in plans for path in sorted(plan.folder.glob("*.mcap"))]
        text = "kept: " + ", ".join(kept) if kept else "nothing was kept"
        raise KeyboardInterrupt(text) from None
    finally:
        remove_empty(made)
    return summaries


def _summary(scenario: Scenario, logs: Sequence[TrialLog]) -> Summary:
    """What `summary.json` says, with what belongs to the kind of scene alone."""
    from proxcgal.evaluation.phases import mean_distances
    from proxcgal.scenario.hri_scenario import HriScenario
    from proxcgal.scenario.walkthrough_scenario import GuidedScenario
    from proxcgal.trial.walkthrough.guided_source import off_paths

    summary = static_summary(logs)
    if isinstance(scenario, HriScenario):
        recorded = scenario.operator.recording is not None
        summary["subject"] = None if recorded else scenario.operator.subject
        summary["recording"] = scenario.operator.who if recorded else None
        summary["gain_mm"] = None  # of the run's end, when the person has left
        for log in logs:
            summary["controllers"][log.controller]["mean_m"] = {
                phase: {"true": true, "seen": seen}
                for phase, (true, seen) in mean_distances(log, scenario).items()
            }
    if isinstance(scenario, GuidedScenario):
        summary["tool_off_path_m"] = off_paths(scenario, logs)
    return summary


def check(
    scenario: Scenario,
    controllers: Sequence[str],
    robot: Robot | None = None,
    *,
    quiet: bool = False,
) -> None:
    """Sets everything up once, so that nothing is written where something does not fit.

    A robot that is new to this machine has its meshes prepared here, and kept for the workers.

    Args:
        scenario: to be set up.
        controllers: so are these.
        robot: the scenario's, where it is loaded already.
        quiet: no word on stderr.

    Raises:
        ProxError: what of the scenario, the robot or the sensors cannot be; sensors that do not
            sit where the scenario says.
    """
    from proxcgal.scenario.setup import Setup
    from proxcgal.scenario.walkthrough_scenario import WalkScenario
    from proxcgal.trial.trial import assemble
    from proxcgal.trial.walkthrough.setup import WalkSetup

    if isinstance(scenario, WalkScenario):
        WalkSetup.of(scenario, robot)
        return
    announce(f"setting up {scenario.name} (a robot's first time takes a while)", quiet=quiet)
    setup = Setup.of(scenario, robot)
    runs = [assemble(setup, controller) for controller in controllers]
    sensed = next((run for run in runs if run.world is not None), None)
    checks = None if sensed is None else sensed.require_mounts()
    if checks is not None:
        announce(
            f"{scenario.name}: {checks.judged} of {len(checks.sensors)} sensors see enough of the "
            "arm itself for their mounts to be judged; none is wrong",
            quiet=quiet,
        )


def combine(folder: Path, summaries: Sequence[Summary], origin: dict[str, Any]) -> None:
    """Writes the numbers of several scenarios to the folder above theirs."""
    write_json(folder / "run.json", origin)
    write_json(folder / "summary.json", combined(summaries))


def remove_empty(folders: Sequence[Path]) -> None:
    """Removes those of the folders, innermost last, that nothing was written to."""
    for path in reversed(folders):
        with contextlib.suppress(OSError):
            path.rmdir()


def ready(folders: Sequence[Path]) -> list[Path]:
    """Makes the folders, shows that they can be written, removes an earlier run's files.

    Returns:
        The folders that were not there before, innermost last.

    Raises:
        ConfigError: a folder cannot be made or written, or holds a campaign; none is left behind
            that was not there.
    """
    from proxcgal.study.store import MANIFEST

    for folder in folders:
        if (folder / MANIFEST).exists():
            raise ConfigError(
                f"--out {folder}: holds a campaign; name another folder, or remove it"
            )
    made: list[Path] = []
    try:
        for folder in folders:
            missing = [p for p in (folder, *folder.parents) if not p.exists()]
            for path in reversed(missing):
                path.mkdir()
                made.append(path)
            with tempfile.TemporaryFile(dir=folder) as probe:
                probe.write(b"proxcgal")
    except OSError as error:
        remove_empty(made)
        raise ConfigError(f"--out {folder}: cannot be written: {error.strerror or error}") from None
    from proxcgal.scenario.scenario import CONTROLLERS

    for folder in folders:
        for name in (*FILES, *(f"{controller}.mcap" for controller in CONTROLLERS)):
            (folder / name).unlink(missing_ok=True)
    return made


def _simulate(pool: Pool, trials: Sequence[tuple[Plan, str]], quiet: bool) -> list[TrialLog]:
    from proxcgal.study.trials import simulate

    jobs = [
        functools.partial(
            simulate,
            plan.scenario,
            name,
            plan.scenario.seed,
            recording=plan.folder / f"{name}.mcap",
            coverage=True,
        )
        for plan, name in trials
    ]
    seconds = [plan.scenario.duration for plan, _ in trials]
    with ProgressBar("simulating", seconds, "s", quiet=quiet) as progress:

        def done(row: int, log: TrialLog) -> None:
            numbers = log.summary()
            progress.finished(
                f"{log.scenario} {log.controller}: least true distance "
                f"{numbers['true_min_m']:.3f} m, {seconds[row]:g} s simulated in {log.wall_s:.1f} s"
            )

        logs: list[TrialLog] = pool.run(jobs, progress.shares, done)
    warn_of_stopped(logs)
    return logs


def warn_of_stopped(logs: Sequence[TrialLog]) -> None:
    """Says which recordings stopped early: where they were made, a worker kept quiet."""
    for log in logs:
        if log.recording_failure:
            warnings.warn(log.recording_failure, RuntimeWarning, stacklevel=3)


def _draw(
    pool: Pool,
    plans: Sequence[Plan],
    grouped: Sequence[Sequence[TrialLog]],
    pictures: bool,
    quiet: bool,
) -> None:
    from proxcgal.study.runs.pictures import draw_figures, draw_motion

    jobs: list[Any] = []
    for plan, logs in zip(plans, grouped, strict=True):
        if pictures:  # first: it takes longest
            jobs.append(functools.partial(draw_motion, plan.scenario, plan.folder))
        jobs.append(functools.partial(draw_figures, plan.scenario, list(logs), plan.folder))
    with ProgressBar("drawing", [1.0] * len(jobs), "", quiet=quiet) as progress:
        pool.run(jobs, progress.shares, lambda _, text: progress.finished(text))


def _about(plan: Plan, logs: Sequence[TrialLog], origin: dict[str, Any]) -> dict[str, Any]:
    """What `run.json` says: how it was made, and what each trial took and found."""
    trials = {}
    for log in logs:
        modes, counts = np.unique(log.mode, return_counts=True)
        trials[log.controller] = {
            "wall_s": float(log.wall_s),
            "ticks": len(log.time),
            "tick_median_us": float(np.median(log.tick_us)),
            "tick_p99_us": float(np.percentile(log.tick_us, 99)),
            "findings": {str(reason): int(n) for reason, n in log.findings.items()},
            "mode_ticks": {str(m): int(n) for m, n in zip(modes, counts, strict=True)},
        }
    return {**origin, "description": plan.scenario.description, "trials": trials}

"""Runs of scenes: each controller once, numbers and pictures in a folder a scene."""

import functools
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from proxcgal.core.files import write_json, write_text
from proxcgal.core.progress import ProgressBar
from proxcgal.core.provenance import origin
from proxcgal.evaluation.metrics import (
    SELF_LIMIT_M,
    Summary,
    combined,
    coverage_lines,
    static_summary,
    table,
)
from proxcgal.evaluation.phases import mean_distances
from proxcgal.evaluation.trial_log import TrialLog
from proxcgal.scenario.hri_scenario import HriScenario
from proxcgal.scenario.joint_scenario import JointScenario
from proxcgal.scenario.scenario import Scenario
from proxcgal.scenario.walkthrough_scenario import GuidedScenario, WalkScenario
from proxcgal.study.jobs import Job
from proxcgal.study.runs.joint import run_joint
from proxcgal.study.runs.pictures import draw_figures, draw_motion
from proxcgal.study.runs.preparation import check_setup, ready_folders
from proxcgal.study.runs.walkthrough import run_walkthrough
from proxcgal.study.trial_simulation import simulate_all, simulate_trial
from proxcgal.study.workers import Pool, default_workers
from proxcgal.trial.walkthrough.guided_source import off_paths


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenePlan:
    """Trials of one scenario, and where their results go."""

    scenario: Scenario
    controllers: tuple[str, ...]
    folder: Path


def run_scenes(
    plans: Sequence[ScenePlan],
    command: str,
    *,
    together: Path | None = None,
    workers: int | None = None,
    pictures: bool = True,
    quiet: bool = False,
) -> bool:
    """Runs all trials, fills the plans' folders, and prints the table and what failed.

    Args:
        plans: what to run.
        command: as typed; for `run.json`.
        together: folder that gets the numbers of all scenarios.
        workers: processes; None takes one a processor.
        pictures: draw the moving picture too.
        quiet: no progress on stderr.

    Returns:
        True where an arm came too near to itself: such a run has failed.

    Raises:
        ProxError: what does not fit; a trial failed: recordings up to then are kept.
        KeyboardInterrupt: with a message of what was kept.
    """
    for plan in plans:
        check_setup(plan.scenario, plan.controllers, quiet=quiet)
    made = origin(command)
    with nullcontext() if together is None else ready_folders([together]):
        summaries = _perform(plans, made, workers, pictures, quiet)
        if together is not None:
            write_json(together / "run.json", made)
            write_json(together / "summary.json", combined(summaries))
    print(table(summaries))
    for summary in summaries:
        for line in coverage_lines(summary["scenario"], summary["closest_points"]):
            print(line)
    failed = [summary for summary in summaries if summary["failed"]]
    for summary in failed:
        print(
            f"proxcgal: {summary['scenario']}: failed: the arm came within "
            f"{summary['self_min_m']:.3f} m of itself, allowed is {SELF_LIMIT_M} m",
            file=sys.stderr,
        )
    return bool(failed)


def _perform(
    plans: Sequence[ScenePlan],
    made: dict[str, Any],
    workers: int | None,
    pictures: bool,
    quiet: bool,
) -> list[Summary]:
    """One summary per plan, as written to its folder."""
    trials = [(plan, name) for plan in plans for name in plan.controllers]
    summaries = []
    try:
        with (
            ready_folders([plan.folder for plan in plans]),
            Pool(workers or default_workers(len(trials))) as pool,
        ):
            logs = iter(_simulate(pool, trials, quiet))
            grouped = [[next(logs) for _ in plan.controllers] for plan in plans]
            for plan, own in zip(plans, grouped, strict=True):
                summaries.append(_summary(plan.scenario, own))
                write_text(plan.folder / "scenario.toml", plan.scenario.to_toml())
                write_json(plan.folder / "run.json", _about(plan, own, made))
                write_json(plan.folder / "summary.json", summaries[-1])
            _draw(pool, plans, grouped, pictures, quiet)
    except KeyboardInterrupt:
        kept = [str(path) for plan in plans for path in sorted(plan.folder.glob("*.mcap"))]
        text = "kept: " + ", ".join(kept) if kept else "nothing was kept"
        raise KeyboardInterrupt(text) from None
    return summaries


def _simulate(pool: Pool, trials: Sequence[tuple[ScenePlan, str]], quiet: bool) -> list[TrialLog]:
    jobs = [
        functools.partial(
            simulate_trial, plan.scenario, name, plan.scenario.seed,
            recording=plan.folder / f"{name}.mcap", coverage=True,
        )
        for plan, name in trials
    ]  # fmt: skip
    seconds = [plan.scenario.duration for plan, _ in trials]

    def line(row: int, log: TrialLog) -> str:
        return (
            f"{log.scenario} {log.controller}: least true distance "
            f"{log.summary()['true_min_m']:.3f} m, {seconds[row]:g} s simulated in "
            f"{log.wall_s:.1f} s"
        )

    return simulate_all(pool, jobs, seconds, line, quiet=quiet)


def _summary(scenario: Scenario, logs: Sequence[TrialLog]) -> Summary:
    """The content of `summary.json`, with what belongs to the kind of scene alone."""
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


def _about(plan: ScenePlan, logs: Sequence[TrialLog], made: dict[str, Any]) -> dict[str, Any]:
    """The content of `run.json`: how it was made, and what each trial took and found."""
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
    return {**made, "description": plan.scenario.description, "trials": trials}


def _draw(
    pool: Pool,
    plans: Sequence[ScenePlan],
    grouped: Sequence[Sequence[TrialLog]],
    pictures: bool,
    quiet: bool,
) -> None:
    jobs: list[Job] = []
    for plan, logs in zip(plans, grouped, strict=True):
        if pictures:  # first: it takes longest
            jobs.append(functools.partial(draw_motion, plan.scenario, plan.folder))
        jobs.append(functools.partial(draw_figures, plan.scenario, list(logs), plan.folder))
    with ProgressBar("drawing", [1.0] * len(jobs), "", quiet=quiet) as progress:
        pool.run(jobs, progress.shares, lambda _, text: progress.finished(text))


def run_scenario(
    scenario: Scenario,
    controllers: Sequence[str],
    folder: Path,
    command: str,
    *,
    workers: int | None = None,
    pictures: bool = True,
    quiet: bool = False,
) -> bool:
    """Runs it, fills the folder, the report apart, and prints the results.

    Args:
        scenario: what to run.
        controllers: instead of the scenario's own, where any are named; a walk-through has none.
        folder: of the results.
        command: as typed; for `run.json`.
        workers: processes; None takes one a processor.
        pictures: draw the moving picture too.
        quiet: no progress on stderr.

    Returns:
        True where the run has failed: the robot came too near to itself.

    Raises:
        ProxError: what does not fit, a run that cannot go on.
        KeyboardInterrupt: with a message of what was kept.
    """
    if isinstance(scenario, WalkScenario):
        run_walkthrough(scenario, folder, command, quiet=quiet)
        return False
    names = tuple(dict.fromkeys(controllers or scenario.controllers()))
    if isinstance(scenario, JointScenario):
        return run_joint(scenario, names, folder, command, workers=workers, quiet=quiet)
    plan = ScenePlan(scenario=scenario, controllers=names, folder=folder)
    return run_scenes([plan], command, workers=workers, pictures=pictures, quiet=quiet)

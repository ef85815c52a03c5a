"""Runs of a scene for the 12-joint robot: from each initial configuration of its file."""

import functools
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from proxcgal.core.errors import ConfigError
from proxcgal.core.files import write_bytes, write_json, write_text
from proxcgal.core.provenance import origin
from proxcgal.evaluation.metrics import SELF_LIMIT_M, Summary
from proxcgal.evaluation.trial_log import TrialLog
from proxcgal.models.macro_micro import part
from proxcgal.scenario.controller_keys import STACKS
from proxcgal.scenario.joint_scenario import JointScenario
from proxcgal.study.joint.figures import joint_figure
from proxcgal.study.joint.metrics import joint_metrics
from proxcgal.study.joint.texts import listings, verdicts
from proxcgal.study.plotting import png
from proxcgal.study.runs.preparation import check_setup, ready_folders
from proxcgal.study.trial_simulation import robot_of, simulate_all, simulate_trial
from proxcgal.study.workers import Pool, default_workers

FIGURE = "joint.png"
_PERCEPTIONS = {"wb_known": "known", "wb_memory": "memory", "sm": "sensed, sensor points"}


def run_joint(
    scenario: JointScenario,
    controllers: Sequence[str],
    folder: Path,
    command: str,
    *,
    workers: int | None,
    quiet: bool,
) -> bool:
    """Runs each controller from each start, fills the folder, and prints tables and verdicts.

    Args:
        scenario: with its initial configurations.
        controllers: from CONTROLLERS.
        folder: of the results.
        command: as typed; for `run.json`.
        workers: processes; None takes one a processor.
        quiet: no progress on stderr.

    Returns:
        True where the robot came too near to itself; a goal not reached is a result.

    Raises:
        ProxError: what does not fit, a run that cannot go on.
    """
    if scenario.q0:
        raise ConfigError(
            f"scenario {scenario.name}: q0: runs begin from `initial`; add a configuration instead"
        )
    starts = scenario.starts()
    for start in starts:
        check_setup(start, controllers, quiet=quiet)
        part(robot_of(start), start.controller.macro_joints, "macro")  # its table has both arms
    with ready_folders([folder]):
        jobs = [(start, name) for start in starts for name in controllers]
        for start, name in jobs:
            _recording(folder, start, name).unlink(missing_ok=True)
        rows = _runs(jobs, folder, workers, quiet)
        # What a campaign's table has beside these are strings for its figures.
        runs = [{key: value for key, value in row.items() if key != "series"} for row in rows]
        own = [row["self_min_m"] for row in rows]
        summary: Summary = {
            "scenario": scenario.name, "robot": rows[0]["robot"], "seed": scenario.seed,
            "runs": runs,
            "self_min_m": min(own), "self_under_limit": sum(value < SELF_LIMIT_M for value in own),
            "failed": min(own) < SELF_LIMIT_M,
        }  # fmt: skip
        write_text(folder / "scenario.toml", scenario.to_toml())
        write_json(folder / "run.json", {**origin(command), "description": scenario.description})
        shown = [{**row, "stack": "full"} for row in rows]  # whatever the stack is
        write_bytes(folder / FIGURE, png(joint_figure(scenario.name, shown)))
        write_json(folder / "summary.json", summary)
        for listing in listings(summary):
            if listing.rows:
                print(f"{listing}\n")
        for sentence in verdicts(summary):
            print(sentence)
        if summary["failed"]:
            print(
                f"proxcgal: {scenario.name}: failed: the robot came within {min(own):.3f} m of "
                f"itself, allowed is {SELF_LIMIT_M} m", file=sys.stderr,
            )  # fmt: skip
        return bool(summary["failed"])


def _recording(folder: Path, start: JointScenario, controller: str) -> Path:
    return folder / f"{start.initial[0]}-{controller}.mcap"


def _runs(
    jobs: Sequence[tuple[JointScenario, str]], folder: Path, workers: int | None, quiet: bool
) -> list[dict[str, Any]]:
    """Simulates; one entry per run, as the campaign's table has it."""
    calls = [
        functools.partial(
            simulate_trial, start, name, start.seed, recording=_recording(folder, start, name)
        )
        for start, name in jobs
    ]

    def line(row: int, log: TrialLog) -> str:
        start, name = jobs[row]
        reason = log.ending.reason if log.ending else ""
        return f"{start.name} {start.initial[0]} {name}: {reason}"

    seconds = [start.duration for start, _ in jobs]
    with Pool(workers or default_workers(len(jobs))) as pool:
        logs = simulate_all(pool, calls, seconds, line, quiet=quiet)
    stacks: dict[tuple[str, ...], str] = {tasks: name for name, tasks in STACKS.items()}
    runs = []
    for (start, name), log in zip(jobs, logs, strict=True):
        levels = tuple(start.controller.levels)
        sensed = "known" if start.perception == "known" else "sensed"
        runs.append(
            {"scenario": start.name, "robot": log.robot, "init": start.initial[0],
             "tasks": list(levels), "stack": stacks.get(levels, ", ".join(levels)),
             "perception": _PERCEPTIONS.get(name, sensed), "controller": name, "seed": start.seed,
             **joint_metrics(log, start, robot_of(start))}
        )  # fmt: skip
    return runs

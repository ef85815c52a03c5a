"""`proxcgal run` of a scene for the 12-joint robot: from each initial configuration of its file."""

from __future__ import annotations

import functools
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from proxcgal.core.errors import ConfigError
from proxcgal.core.progress import ProgressBar

if TYPE_CHECKING:
    from collections.abc import Sequence

    from proxcgal.evaluation.metrics import Summary
    from proxcgal.evaluation.trial_log import TrialLog
    from proxcgal.scenario.joint_scenario import JointScenario

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
) -> int:
    """Runs each controller from each start; prints the table and the report's path.

    Returns:
        1 where the robot came too near to itself, else 0: a goal not reached is a result.

    Raises:
        ProxError: what does not fit, a run that cannot go on.
    """
    from proxcgal.core.files import write_bytes, write_json, write_text
    from proxcgal.core.provenance import origin
    from proxcgal.evaluation.metrics import SELF_LIMIT_M
    from proxcgal.models.macro_micro import part
    from proxcgal.report.report import write_report
    from proxcgal.study.figures import png
    from proxcgal.study.joint.figures import scene_figure
    from proxcgal.study.joint.texts import listings, verdicts
    from proxcgal.study.runs.results import check, ready
    from proxcgal.study.trials import robot_of

    if scenario.q0:
        raise ConfigError(
            f"scenario {scenario.name}: q0: runs begin from `initial`; add a configuration instead"
        )
    starts = scenario.starts()
    for start in starts:
        check(start, controllers, quiet=quiet)
        part(robot_of(start), start.controller.macro_joints, "macro")  # its table tells both arms
    ready([folder])
    jobs = [(start, name) for start in starts for name in controllers]
    for start, name in jobs:
        _recording(folder, start, name).unlink(missing_ok=True)
    rows = _rows(jobs, folder, workers, quiet)
    # What a campaign's table has beside these are strings for its figures.
    runs = [{key: value for key, value in row.items() if key != "series"} for row in rows]
    own = [row["self_min_m"] for row in rows]
    summary: Summary = {
        "scenario": scenario.name, "robot": rows[0]["robot"], "seed": scenario.seed, "runs": runs,
        "self_min_m": min(own), "self_under_limit": sum(value < SELF_LIMIT_M for value in own),
        "failed": min(own) < SELF_LIMIT_M,
    }  # fmt: skip
    write_text(folder / "scenario.toml", scenario.to_toml())
    made = origin(command)
    write_json(folder / "run.json", {**made, "description": scenario.description})
    shown = [{**row, "stack": "full"} for row in rows]  # whatever the stack is
    write_bytes(folder / FIGURE, png(scene_figure(scenario.name, shown)))
    write_json(folder / "summary.json", summary)
    report = write_report(folder)
    for listing in listings(summary):
        if listing.rows:
            print(f"{listing}\n")
    for sentence in verdicts(summary):
        print(sentence)
    if summary["failed"]:
        print(
            f"proxcgal: {scenario.name}: failed: the robot came within {min(own):.3f} m of itself, "
            f"allowed is {SELF_LIMIT_M} m", file=sys.stderr,
        )  # fmt: skip
    print(report)
    return 1 if summary["failed"] else 0


def _recording(folder: Path, start: JointScenario, controller: str) -> Path:
    return folder / f"{start.initial[0]}-{controller}.mcap"


def _rows(
    jobs: Sequence[tuple[JointScenario, str]], folder: Path, workers: int | None, quiet: bool
) -> list[dict[str, Any]]:
    from proxcgal.study.joint.metrics import numbers_of
    from proxcgal.study.runs.results import warn_of_stopped
    from proxcgal.study.trials import robot_of, simulate
    from proxcgal.study.workers import Pool, default_workers

    calls = [
        functools.partial(
            simulate, start, name, start.seed, recording=_recording(folder, start, name)
        )
        for start, name in jobs
    ]
    with (
        Pool(workers or default_workers(len(jobs))) as pool,
        ProgressBar("simulating", [s.duration for s, _ in jobs], "s", quiet=quiet) as progress,
    ):

        def done(row: int, log: TrialLog) -> None:
            start, name = jobs[row]
            reason = log.ending.reason if log.ending else ""
            progress.finished(f"{start.name} {start.initial[0]} {name}: {reason}")

        logs: list[TrialLog] = pool.run(calls, progress.shares, done)
    warn_of_stopped(logs)
    rows = []
    for (start, name), log in zip(jobs, logs, strict=True):
        levels = start.controller.levels
        sensed = "known" if start.perception == "known" else "sensed"
        rows.append(
            {"scenario": start.name, "robot": log.robot, "init": start.initial[0],
             "tasks": list(levels), "stack": _named(levels),
             "perception": _PERCEPTIONS.get(name, sensed), "controller": name, "seed": start.seed,
             **numbers_of(log, start, robot_of(start))}
        )  # fmt: skip
    return rows


def _named(levels: Sequence[str]) -> str:
    """The stack's name where it has one, else its tasks."""
    from proxcgal.scenario.controller_keys import STACKS

    known: dict[tuple[str, ...], str] = {tasks: name for name, tasks in STACKS.items()}
    return known.get(tuple(levels), ", ".join(levels))

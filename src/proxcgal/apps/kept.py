"""Recordings of a campaign's worst trials, made by running them again: they repeat bit for bit."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from proxcgal.apps.progress import Progress
from proxcgal.study.jobs import Report
from proxcgal.study.pool import Pool

if TYPE_CHECKING:
    from proxcgal.sim.recorder import RecordedTicks
    from proxcgal.study.campaign import Ended, Trial

FOLDER = "recordings"


def keep_worst(
    chosen: Sequence[Ended], folder: Path, ticks: RecordedTicks, workers: int, *, quiet: bool
) -> list[dict[str, Any]]:
    """Records these trials, on this machine; recordings of other trials are removed.

    Args:
        chosen: the worst first.
        folder: of the campaign.
        ticks: which of them are recorded.
        workers: processes.
        quiet: no progress on stderr.

    Returns:
        Name, file below the folder and command of each: plain JSON values.
    """
    place = folder / FOLDER
    files = {f"{each.trial.name}.mcap": each for each in chosen}
    for old in [*place.glob("*.mcap"), *place.glob(".*.mcap")]:
        if old.name not in files:
            old.unlink()
    jobs = [functools.partial(_record, e.trial, place / name, ticks) for name, e in files.items()]
    sizes = [each.trial.scenario.duration for each in chosen]
    with (
        Pool(max(min(workers, len(jobs)), 1)) as pool,
        Progress("recording the worst", sizes, "s", quiet=quiet) as progress,
    ):
        repeated = pool.run(jobs, progress.shares)
    for each, numbers in zip(chosen, repeated, strict=True):
        row = each.outcome.row or {}
        apart = [key for key, value in numbers.items() if key in row and row[key] != value]
        if apart:
            warnings.warn(
                f"{each.trial.name} did not repeat itself: {', '.join(apart)} differ from the "
                "campaign's; was it run on another machine?", RuntimeWarning, stacklevel=2,
            )  # fmt: skip
    return [
        {"name": e.trial.name, "recording": f"{FOLDER}/{name}", "command": e.trial.command}
        for name, e in files.items()
    ]


def _record(trial: Trial, path: Path, ticks: RecordedTicks, report: Report) -> dict[str, Any]:
    """Records one trial, in whichever process; the file is whole or not there."""
    from proxcgal.study.trials import simulate

    half = path.with_name(f".{path.name}")
    log = simulate(
        trial.scenario, trial.controller, trial.seed, report, recording=half, ticks=ticks
    )
    half.replace(path)
    numbers: dict[str, Any] = log.summary()
    del numbers["wall_s"]
    return numbers

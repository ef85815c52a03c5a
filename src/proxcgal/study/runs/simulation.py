"""Recorded trials side by side, with their progress."""

import warnings
from collections.abc import Callable, Sequence

from proxcgal.core.progress import ProgressBar
from proxcgal.evaluation.trial_log import TrialLog
from proxcgal.study.jobs import Job
from proxcgal.study.workers import Pool


def simulate_all(
    pool: Pool,
    jobs: Sequence[Job],
    seconds: Sequence[float],
    line: Callable[[int, TrialLog], str],
    *,
    quiet: bool,
) -> list[TrialLog]:
    """Runs recorded trials; warns of recordings that stopped early.

    Args:
        pool: does the work.
        jobs: each returns its trial's log.
        seconds: [s] simulated by each.
        line: what a log file of the progress says of an ended trial, by its row.
        quiet: no progress on stderr.
    """
    with ProgressBar("simulating", seconds, "s", quiet=quiet) as progress:
        logs: list[TrialLog] = pool.run(
            jobs, progress.shares, lambda row, log: progress.finished(line(row, log))
        )
    warn_of_stopped(logs)
    return logs


def warn_of_stopped(logs: Sequence[TrialLog]) -> None:
    """Warns of recordings that stopped early; the workers' own warnings are suppressed."""
    for log in logs:
        if log.recording_failure:
            warnings.warn(log.recording_failure, RuntimeWarning, stacklevel=3)

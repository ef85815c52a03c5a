"""Recordings of a campaign's worst trials, made by running them again: they repeat bit for bit."""

import functools
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from proxcgal.core.errors import RecordingError
from proxcgal.core.progress import OnProgress, ProgressBar
from proxcgal.core.provenance import versions
from proxcgal.recording.reader import read_recording
from proxcgal.recording.writer import RecordedTicks
from proxcgal.study.campaign import Ended, Trial
from proxcgal.study.execution import failure_text
from proxcgal.study.jobs import StoppedError
from proxcgal.study.trial_simulation import simulate_trial
from proxcgal.study.workers import Pool

FOLDER = "recordings"


def record_worst(
    chosen: Sequence[Ended], folder: Path, ticks: RecordedTicks, pool: Pool, *, quiet: bool
) -> list[dict[str, Any]]:
    """Records these trials, unless they are there; recordings of other trials are removed.

    Args:
        chosen: the worst first.
        folder: of the campaign.
        ticks: which of them are recorded.
        pool: workers of this machine.
        quiet: no progress on stderr.

    Returns:
        Name, file below the folder and command of each: plain JSON values. `error` in place of the
        file says why there is none.
    """
    place = folder / FOLDER
    files = {f"{each.trial.name}.mcap": each for each in chosen}
    for old in list(place.glob("*.mcap")):  # half ones of a process that was killed too
        if old.name not in files:
            old.unlink()
    todo = {n: e for n, e in files.items() if not _there(place / n, e.trial, ticks)}
    jobs = [functools.partial(_record, e.trial, place / name, ticks) for name, e in todo.items()]
    sizes = [each.trial.scenario.duration for each in todo.values()]
    with ProgressBar("recording the worst", sizes, "s", quiet=quiet) as progress:
        answers = pool.run(
            jobs,
            progress.shares,
            on_lost=lambda _, deaths: f"its worker process died, {deaths} times (out of memory?)",
        )
    errors: dict[str, str] = {}
    for (name, each), answer in zip(todo.items(), answers, strict=True):
        if isinstance(answer, str):
            errors[name] = answer
        else:
            _compare(each, answer)
    return [_entry(e.trial, name, errors.get(name)) for name, e in files.items()]


def _entry(trial: Trial, name: str, error: str | None) -> dict[str, Any]:
    what = {"recording": f"{FOLDER}/{name}"} if error is None else {"error": error}
    return {"name": trial.name, **what, "command": trial.command}


def _there(path: Path, trial: Trial, ticks: RecordedTicks) -> bool:
    """Is the trial's recording there, whole, of these ticks and this build?"""
    try:
        recording = read_recording(path)
    except RecordingError:
        return False
    made = recording.settings
    scenario = trial.scenario.model_copy(update={"seed": trial.seed})
    return recording.damage is None and (
        (made.scenario.to_toml(), made.controller, made.seed, made.ticks, made.versions)
        == (scenario.to_toml(), trial.controller, trial.seed, ticks, versions())
    )


def _compare(ended: Ended, numbers: Mapping[str, Any]) -> None:
    """Warns where the recorded run has other numbers than the campaign's."""
    row = ended.outcome.row or {}
    apart = [key for key, value in numbers.items() if key in row and row[key] != value]
    if apart:
        warnings.warn(
            f"{ended.trial.name} did not repeat itself: {', '.join(apart)} differ from the "
            "campaign's; was it run on another machine?", RuntimeWarning, stacklevel=3,
        )  # fmt: skip


def _record(
    trial: Trial, path: Path, ticks: RecordedTicks, report: OnProgress
) -> dict[str, Any] | str:
    """Records one trial, in whichever process; the file is whole, or there is none.

    Returns:
        The run's numbers, or what went wrong.
    """
    half = path.with_name(f".{path.name}")
    try:
        log = simulate_trial(
            trial.scenario, trial.controller, trial.seed, report, recording=half, ticks=ticks,
            robot_digest=trial.robot_digest,
        )  # fmt: skip
        if log.recording_failure is not None:
            return log.recording_failure
        half.replace(path)
    except StoppedError:
        raise
    except Exception as problem:
        return failure_text(problem)
    finally:
        half.unlink(missing_ok=True)
    numbers: dict[str, Any] = log.summary()
    del numbers["wall_s"]
    return numbers

"""All trials of a campaign brought to an end, each stored at once; then their table."""

import functools
import io
import time as clock
import traceback
from collections.abc import Callable, Sequence

import polars as pl

from proxcgal.core.errors import ConfigError, ProxError
from proxcgal.core.progress import OnProgress
from proxcgal.study.campaign import Campaign, Ended, Perform, Trial
from proxcgal.study.campaign_store import CampaignStore, Outcome
from proxcgal.study.jobs import StoppedError
from proxcgal.study.workers import Pool


def unfinished(campaign: Campaign, store: CampaignStore) -> list[Trial]:
    """The trials that the store does not hold, or holds as failed or with other numbers.

    Raises:
        ConfigError: a trial stands twice in the campaign.
    """
    trials = {trial.key: trial for trial in campaign.trials}
    if len(trials) < len(campaign.trials):
        twice = next(trial for trial in campaign.trials if trials[trial.key] is not trial)
        raise ConfigError(f"campaign: {twice.name} stands in it twice")
    columns = set(campaign.columns)
    ended = {key for key, o in store.outcomes(trials).items() if o.row and o.row.keys() == columns}
    return [trial for key, trial in trials.items() if key not in ended]


def perform_trials(
    campaign: Campaign,
    store: CampaignStore,
    pool: Pool,
    on_progress: Callable[[list[float]], None] | None = None,
    on_done: Callable[[Trial, Outcome], None] = lambda *_: None,
) -> list[Ended]:
    """Performs every unfinished trial; one that fails is kept with its error and stops nothing.

    Args:
        campaign: what to run.
        store: gets every outcome as soon as there is one.
        pool: does the work.
        on_progress: called with the shares done of the unfinished trials, now and then.
        on_done: called with every trial that ended, after it is stored.

    Returns:
        All trials in the campaign's order, wherever and whenever they ran.

    Raises:
        ConfigError: a trial stands twice in the campaign.
        SimulationError: the cluster was lost on the way.
    """
    todo = unfinished(campaign, store)

    def done(row: int, outcome: Outcome) -> None:
        store.put(outcome)
        on_done(todo[row], outcome)

    def lost(row: int, deaths: int) -> Outcome:
        times = {1: "once", 2: "twice"}.get(deaths, f"{deaths} times")
        return Outcome(
            key=todo[row].key, error=f"its worker process died, {times} (out of memory?)"
        )

    pool.run(
        [functools.partial(_attempt, campaign.perform, trial) for trial in todo],
        on_progress, done, lost,
    )  # fmt: skip
    outcomes = store.outcomes(trial.key for trial in campaign.trials)
    return [Ended(trial=trial, outcome=outcomes[trial.key]) for trial in campaign.trials]


def _attempt(perform: Perform, trial: Trial, report: OnProgress) -> Outcome:
    """One trial, in whichever process; what goes wrong becomes part of the outcome."""
    begin = clock.perf_counter()
    try:
        row, error = perform(trial, report), None
    except StoppedError:
        raise
    except Exception as problem:
        row, error = None, failure_text(problem)
    return Outcome(key=trial.key, row=row, error=error, wall_s=clock.perf_counter() - begin)


def failure_text(problem: Exception) -> str:
    """What went wrong; of an error that is not the package's own with its place in the code."""
    if isinstance(problem, ProxError):
        return str(problem)
    place = traceback.extract_tb(problem.__traceback__)[-1]
    at = f"{place.filename.rpartition('/')[2]}:{place.lineno}"
    return f"{type(problem).__name__}: {problem} ({at})"


def trials_table(ended: Sequence[Ended], columns: Sequence[str]) -> pl.DataFrame:
    """One row a trial in the campaign's order: what it is, its numbers, what it took.

    Args:
        ended: all trials.
        columns: of the numbers; null where a trial failed.
    """
    rows = [
        {"key": trial.key, "name": trial.name, **trial.tags}
        | {"scenario": trial.scenario.name, "robot": trial.scenario.robot}
        | {"controller": trial.controller, "seed": trial.seed}
        | {column: (outcome.row or {}).get(column) for column in columns}
        | {"error": outcome.error, "command": trial.command, "wall_s": outcome.wall_s}
        for trial, outcome in ((each.trial, each.outcome) for each in ended)
    ]
    table = pl.DataFrame(rows, schema_overrides={"error": pl.String}, infer_schema_length=None)
    empty = [name for name in columns if table.schema[name] == pl.Null]  # all trials failed
    return table.with_columns(pl.col(empty).cast(pl.Float64))


def parquet_bytes(table: pl.DataFrame) -> bytes:
    """The table as a Parquet file's bytes."""
    buffer = io.BytesIO()
    table.write_parquet(buffer)
    return buffer.getvalue()

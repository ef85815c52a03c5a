"""A campaign's trials as one tidy table: a row a trial, a column a number."""

import io
from collections.abc import Sequence

import polars as pl

from proxcgal.study.campaign import Ended
from proxcgal.study.campaign_store import Row


def trials_table(ended: Sequence[Ended], columns: Sequence[str]) -> pl.DataFrame:
    """One row a trial in the campaign's order: what it is, its numbers, what it took.

    Args:
        ended: all trials.
        columns: of the numbers; null where a trial failed.
    """
    rows: list[Row] = []
    for each in ended:
        trial, outcome = each.trial, each.outcome
        numbers = outcome.row or {}
        rows.append(
            {"key": trial.key, "name": trial.name, **trial.tags}
            | {"scenario": trial.scenario.name, "robot": trial.scenario.robot}
            | {"controller": trial.controller, "seed": trial.seed}
            | {column: numbers.get(column) for column in columns}
            | {"error": outcome.error, "command": trial.command, "wall_s": outcome.wall_s}
        )
    table = pl.DataFrame(rows, schema_overrides={"error": pl.String}, infer_schema_length=None)
    empty = [name for name in columns if table.schema[name] == pl.Null]  # all trials failed
    return table.with_columns(pl.col(empty).cast(pl.Float64))


def parquet_bytes(table: pl.DataFrame) -> bytes:
    """The table as a Parquet file's bytes."""
    buffer = io.BytesIO()
    table.write_parquet(buffer)
    return buffer.getvalue()

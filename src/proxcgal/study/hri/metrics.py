"""What the human study's trials amount to: the paper's Tables I and II, and what lies behind."""

import json
from collections.abc import Collection

import numpy as np
import polars as pl

from proxcgal.core.typing import Array
from proxcgal.evaluation.metrics import SELF_LIMIT_M, Summary
from proxcgal.evaluation.phases import SAMPLES_HZ
from proxcgal.study.bootstrap import Distances, by_controller, mean_interval, pairs
from proxcgal.study.campaign import Campaign

#: [WA] Tables I and II: mean and sigma_max [m] by row and controller.
PAPER_MEANS = {
    "task1": {"sm": (0.331, 0.129), "wb": (0.339, 0.126)},
    "task2": {"sm": (0.285, 0.189), "wb": (0.310, 0.167)},
    "H1": {"sm": (0.312, 0.099), "wb": (0.327, 0.111)},
    "H2": {"sm": (0.305, 0.143), "wb": (0.316, 0.092)},
    "H3_first": {"sm": (0.224, 0.130), "wb": (0.249, 0.103)},
    "H3_second": {"sm": (0.245, 0.140), "wb": (0.257, 0.122)},
}
#: Where the paper's difference is clear: wb must not be behind sm there.
CLEAR = ("task2", "H3_first", "H3_second")
BEHIND_MM = -5.0  # [mm] the paired interval's lower end must be above it there
COMPARISONS = (
    ("wb", "sm"), ("wb_memory", "sm"), ("wb_known", "sm"), ("wb_memory", "wb"), ("wb_known", "wb")
)  # fmt: skip
SAMPLE_S = 1.0 / SAMPLES_HZ


def analyse(table: pl.DataFrame, campaign: Campaign) -> Summary:
    """The numbers of `summary.json`.

    `mean_m` is the mean over subjects of each trial's mean true distance, `sigma_max_m` the
    standard deviation over subjects at each time, at most over the cycle or phase; `seen_` the
    same of what the controller saw, moments without a cloud left out and counted.
    """
    done = table.filter(pl.col("error").is_null())
    main = _layout(done.filter(pl.col("layout") == "main"))
    jittered = done.filter(pl.col("layout") == "jittered")
    return {
        "subjects": table["subject"].n_unique(),
        "robot": campaign.trials[0].scenario.robot,
        **main,
        "jittered": None if jittered.is_empty() else _layout(jittered),
        "redrawn": campaign.notes["redrawn"],
        "settings": campaign.notes["settings"],
        "recordings": campaign.notes["recordings"],
        "compared": campaign.notes["compared"],
        "self_min_m": done["self_min_m"].min(),
        "self_under_limit": int((done["self_min_m"] < SELF_LIMIT_M).sum()),
        "not_finite": len(done) - int(done["finite"].sum()),
        "limits_violated": len(done) - int(done["limits_kept"].sum()),
        "wall_s": float(done["wall_s"].sum()),
        "simulated_s": float(sum(t.scenario.duration for t in campaign.trials)),
    }


def _layout(table: pl.DataFrame) -> Summary:
    """Both tables, differences and close calls of one layout of the cell."""
    by_task = {
        task: table.filter(pl.col("task") == task)
        for task in table["task"].unique(maintain_order=True)
    }
    phases = {
        (task, phase): window
        for task, own in by_task.items()
        for phase, window in json.loads(own["windows"][0]).items()
    }
    calls = {
        str(name): {
            "trials": len(part),
            "too_close_trials": int((part["too_close_ticks"] > 0).sum()),
            "too_close_ticks": int(part["too_close_ticks"].sum()),
            "blind_ticks": int(part["blind_ticks"].sum()),
            "blind_trials": int((part["blind_ticks"] > 0).sum()),
            "true_min_m": part["true_min_m"].min(),
            "empty_ticks": int(part["empty_ticks"].sum()),
            "ticks": int(part["ticks"].sum()),
            "held_ticks": int(part["held_ticks"].sum()),
            "leaked_points_max": part["leaked_points_max"].max(),
        }
        for (name,), part in table.group_by(["controller"], maintain_order=True)
    }
    return {
        "table1": {task: _cell(own, task) for task, own in by_task.items()},
        "table2": {
            phase: _cell(by_task[task], phase, window) for (task, phase), window in phases.items()
        },
        "paired_mm": {row: _paired(subject_means(table, row)) for row in phase_rows(table)},
        "paired_least_mm": {
            task: _paired(by_controller(own, "true_min_m", "subject"))
            for task, own in by_task.items()
        },
        "too_close": {
            **{name: own["too_close_ticks"] for name, own in calls.items()},
            "of_which_blind": sum(calls[n]["blind_ticks"] for n in ("wb", "sm") if n in calls),
        },
        "close_calls": calls,
    }


def _cell(own: pl.DataFrame, row: str, window: tuple[float, float] | None = None) -> Summary:
    """A table's row: controller by controller."""
    out = {}
    for (name,), part in own.group_by(["controller"], maintain_order=True):
        if window is None:
            means, seen = part["mean_m"].to_list(), part["seen_mean_m"].to_list()
        else:
            of_row = [json.loads(text)[row] for text in part["phase_means"]]
            means, seen = [both[0] for both in of_row], [both[1] for both in of_row]
        out[str(name)] = {
            "mean_m": _mean(means),
            "sigma_max_m": _sigma_max(series(part, "true_m"), window),
            "seen_mean_m": _mean(seen),
            "seen_sigma_max_m": _sigma_max(series(part, "seen_m"), window),
        }
    return out


def series(part: pl.DataFrame, column: str) -> Array:
    """(trials, samples) of a course over time; nan where there is nothing."""
    rows = [np.array(row, np.float64) for row in part[column].to_list()]
    shortest = min((len(row) for row in rows), default=0)
    return np.array([row[:shortest] for row in rows]).reshape(len(rows), shortest)


def _sigma_max(values: Array, window: tuple[float, float] | None) -> float | None:
    """Largest standard deviation over subjects at one time that half of them, and two, have."""
    if window is not None:
        time = np.arange(values.shape[1]) * SAMPLE_S
        values = values[:, (time >= window[0]) & (time < window[1])]
    enough = np.isfinite(values).sum(axis=0) >= max(2.0, 0.5 * len(values))
    if not enough.any():
        return None
    return float(np.nanstd(values[:, enough], axis=0, ddof=1).max())


def _mean(values: list[float | None]) -> float | None:
    there = [value for value in values if value is not None]
    return float(np.mean(there)) if there else None


def phase_rows(table: pl.DataFrame) -> list[str]:
    """Tasks, then their phases: the rows of both tables."""
    firsts = table.unique("task", keep="first", maintain_order=True)
    phases = [phase for text in firsts["windows"] for phase in json.loads(text)]
    return [*firsts["task"].to_list(), *phases]


def subject_means(table: pl.DataFrame, row: str, *, seen: bool = False) -> Distances:
    """Mean true or seen distance in a task or phase."""
    found: dict[str, dict[int, float]] = {}
    whole = "seen_mean_m" if seen else "mean_m"
    columns = ("controller", "subject", "task", whole, "phase_means")
    for controller, subject, task, mean, text in table.select(columns).iter_rows():
        value = mean if task == row else json.loads(text).get(row, (None, None))[seen]
        if value is not None:
            found.setdefault(controller, {})[subject] = value
    return found


def _paired(distances: Distances) -> Summary:
    found = {}
    for one, other in COMPARISONS:
        apart = pairs(distances, one, other).apart_mm
        interval = mean_interval(apart)
        if interval is not None:
            found[f"{one}-{other}"] = {
                "pairs": len(apart), "mean": interval.middle, "low": interval.low,
                "high": interval.high, "positive_share": float(np.mean(np.array(apart) > 0.0)),
            }  # fmt: skip
    return found


def compared(summary: Summary) -> dict[str, dict[str, tuple[float, float]]]:
    """`PAPER_MEANS`, of the rows that come from the paper's own cell."""
    rows = summary.get("compared", PAPER_MEANS)
    return {row: cell for row, cell in PAPER_MEANS.items() if row in rows}


def held(
    layout: Summary, rows: Collection[str] = tuple(PAPER_MEANS)
) -> list[tuple[str, bool, str]]:
    """Every bound of the experiment on one layout: what, whether it holds, the figures.

    Args:
        layout: as `analyse` has it.
        rows: those from the paper's own cell; the others have no bound.
    """
    found = []
    for row in (row for row in CLEAR if row in rows):
        pair = layout["paired_mm"].get(row, {}).get("wb-sm")
        if pair is not None:
            text = (
                f"{pair['mean']:+.1f} mm, 95 % interval {pair['low']:+.1f} to {pair['high']:+.1f}"
            )
            found.append((f"{row}: wb >= sm", pair["mean"] >= 0.0, text))
            found.append((f"{row}: interval above {BEHIND_MM:g} mm", pair["low"] > BEHIND_MM, text))
    close = layout["too_close"]
    if {"wb", "sm"} <= close.keys():
        text = f"{close['wb']} against {close['sm']} ticks"
        found.append(("too close: wb <= sm", close["wb"] <= close["sm"], text))
    return found

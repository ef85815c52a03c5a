"""How much of what sensing costs a memory gives back, over the draws of one scene."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl

from proxcgal.core.files import NOTHING_M
from proxcgal.core.typing import Array
from proxcgal.evaluation.metrics import Summary
from proxcgal.study.bootstrap import ENOUGH, draw_distances, ratio_interval

WORSE_MM = 20.0  # nearer than without memory by more than this, a draw is listed
_ANOTHER_WAY_M = 0.05  # goal errors so far apart are of two ways
MEASURES = ("true_final_m", "true_min_m")


@dataclass(frozen=True, slots=True)
class Shares:
    """One measure of the draws that wb, wb_known and wb_memory all ended, (n,) each [mm]."""

    draws: tuple[int, ...]
    lost: Array  # wb_known over wb: what sensing costs
    regained: Array  # wb_memory over wb


def shares(table: pl.DataFrame, measure: str) -> Shares:
    """The draws of one scene's trials; those that failed, or see nothing, are left out.

    Args:
        table: a row a trial.
        measure: one of MEASURES.
    """
    ends = draw_distances(table, measure)
    wb, known, memory = (ends.get(name, {}) for name in ("wb", "wb_known", "wb_memory"))
    draws = tuple(sorted(wb.keys() & known.keys() & memory.keys()))
    return Shares(
        draws,
        np.array([1000.0 * (known[draw] - wb[draw]) for draw in draws]),
        np.array([1000.0 * (memory[draw] - wb[draw]) for draw in draws]),
    )


def memory_summary(table: pl.DataFrame) -> Summary | None:
    """Per measure the share of the loss that memory closes; and each draw that it makes worse.

    The share is the sum of what is regained over the sum of what is lost, so that a draw without
    loss counts as little as it should; its interval is a bootstrap over the draws.
    """
    found: Summary = {}
    for measure in MEASURES:
        of = shares(table, measure)
        if not of.draws:
            return None
        interval = ratio_interval(of.regained, of.lost)
        found[measure] = {
            "pairs": len(of.draws),
            "lost_mean_mm": float(of.lost.mean()),
            "regained_mean_mm": float(of.regained.mean()),
            "closed_share": interval and interval.middle,
            "low": interval and interval.low,
            "high": interval and interval.high,
            "worse": [
                _worse(table, draw, measure, float(apart))
                for draw, apart in zip(of.draws, of.regained, strict=True)
                if apart < -WORSE_MM
            ],
        }
    return found


def _worse(table: pl.DataFrame, draw: int, measure: str, apart_mm: float) -> Summary:
    own = table.filter(pl.col("draw") == draw)
    wb, memory = (
        own.filter(pl.col("controller") == name).row(0, named=True) for name in ("wb", "wb_memory")
    )
    return {
        "draw": draw, "apart_mm": apart_mm, "wb_m": wb[measure], "wb_memory_m": memory[measure],
        "reason": _reason(wb, memory, measure.removesuffix("_m")),
    }  # fmt: skip


def _reason(wb: Summary, memory: Summary, moment: str) -> str:
    """Where the ways part, then what each trial knew at its own moment, true_min or true_final."""
    known = (_knew(memory, moment, "with it"), _knew(wb, moment, "without"))
    return "; ".join((_parting(wb, memory), *known))


def _parting(wb: Summary, memory: Summary) -> str:
    if memory["held_ticks"] != wb["held_ticks"]:
        return f"held for {memory['held_ticks']} ticks, against {wb['held_ticks']} without memory"
    errors = memory["goal_error_m"], wb["goal_error_m"]
    if abs(errors[0] - errors[1]) > _ANOTHER_WAY_M:
        return f"another way: ends {errors[0]:.3f} m from the goal, against {errors[1]:.3f} m"
    return "to the same end"


def _knew(row: Summary, moment: str, name: str) -> str:
    """One trial at one moment: which link came how near to what, and what was believed then."""
    link = row[f"{moment}_link"] or "the arm"
    text = f"{name}, at {row[f'{moment}_s']:.1f} s {link} is nearest, to what "
    age = row[f"sighting_age_at_{moment}_s"]
    text += {
        "in_view": "was in view",
        "remembered": f"was last in view {_ago(age)}, so within the memory's time",
        "forgotten": f"was last in view {_ago(age)}, longer than the memory's time",
        "never_seen": "no scan had had in view",
    }[row[f"sighting_at_{moment}"]]
    seen = row[f"seen_at_{moment}_m"]
    if seen >= NOTHING_M:
        return f"{text}; nothing was believed near"
    believed = row[f"believed_at_{moment}_link"]
    at = f" at {believed}" if believed else ""
    return f"{text}, and the nearest believed was {seen:.3f} m off{at}"


def _ago(age: float | None) -> str:
    return "at an unknown time" if age is None else f"{age:.2f} s before"


def memory_rows(scene: str, found: Summary | None) -> list[Sequence[str]]:
    """A row a measure, for people."""
    names = {"true_final_m": "at the end", "true_min_m": "least"}
    if found is None:
        return [(scene, name, "0", *"------") for name in names.values()]
    return [
        (
            scene, names[measure], str(part["pairs"]), f"{part['lost_mean_mm']:+.1f}",
            f"{part['regained_mean_mm']:+.1f}", *_percent(part), str(len(part["worse"])),
        )
        for measure, part in found.items()
    ]  # fmt: skip


def _percent(part: Summary) -> tuple[str, str, str]:
    if part["closed_share"] is None:
        return ("-", "-", "-")
    middle, low, high = (
        f"{round(100.0 * part[key]) + 0:d}" for key in ("closed_share", "low", "high")
    )
    return middle, low, high


def memory_sentences(scene: str, found: Summary | None) -> Iterator[str]:
    """What memory closes, and each draw that it makes worse."""
    if found is None:
        return
    for measure, where in (("true_final_m", "at the end"), ("true_min_m", "at the nearest")):
        part = found[measure]
        yield f"{scene}: {where} {_closed(part)}."
        for case in part["worse"]:
            yield (
                f"{scene}, draw {case['draw']}: {where} nearer by {-case['apart_mm']:.0f} mm with "
                f"memory: {case['reason']}."
            )


def _closed(part: Summary) -> str:
    """What share memory closes, and how sure that is."""
    lost = part["lost_mean_mm"]
    if part["closed_share"] is None:
        if lost <= 0.0:
            return "sensing costs nothing in the mean: no share to close"
        return (
            f"sensing costs {lost:.1f} mm in the mean, over the draws too unsure to tell from "
            "nothing: no share to close"
        )
    middle, low, high = _percent(part)
    sure = f"95 % interval {low} to {high} %"
    if part["pairs"] < ENOUGH:
        sure = "too few draws to say how sure that is"
    return (
        f"memory closes {middle} % of what sensing costs ({sure}; {part['regained_mean_mm']:+.1f} "
        f"of {lost:+.1f} mm in the mean of {part['pairs']} draws)"
    )

"""What the human study amounts to, for people: the paper's tables, sentences, captions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from proxcgal.core.tables import counted, in_metres
from proxcgal.evaluation.metrics import SELF_LIMIT_M, Summary
from proxcgal.study.hri.metrics import compared, held
from proxcgal.study.kind import Listing

_LAYOUTS = {"main": "the cell as it is", "jittered": "all positions moved by up to 0.1 m"}
_ROWS = {
    "task1": "Assembly Task 1", "task2": "Assembly Task 2", "H1": "Assembly Operation on H1",
    "H2": "Assembly Operation on H2", "H3_first": "Assembly Operation on H3 (first run)",
    "H3_second": "Assembly Operation on H3 (second run)",
}  # fmt: skip
_FEW = 6  # subjects: fewer give no verdict
_SETTINGS = (
    ("d_min", "m"), ("buffer", "m"), ("avoid_gain", "1/s"), ("nearest", ""), ("reach_gain", "1/s"),
    ("max_linear", "m/s"), ("max_angular", "rad/s"), ("tasks", ""),
)  # fmt: skip


def listings(summary: Summary) -> list[Listing]:
    """Tables I and II beside the paper's, differences, close calls, settings."""
    found = []
    paper = compared(summary)
    for layout, numbers in _layouts(summary):
        where = _LAYOUTS[layout]
        for table, title in (("table1", "Table I, whole cycles"), ("table2", "Table II, phases")):
            if not numbers[table]:
                continue
            found.append(
                Listing(
                    caption=f"{title}; {where}. Mean of the least distance, and the largest "
                    "standard deviation over subjects at one time. Seen: filtered cloud to robot, "
                    "the paper's own measure; true: exact meshes against the human's exact "
                    "surface.",
                    names=(
                        "controller",
                        "row",
                        "seen mean",
                        "seen sigma",
                        "paper mean",
                        "paper sigma",
                        "ours - paper",
                        "true mean",
                        "true sigma",
                    ),
                    units=("", "", "m", "m", "m", "m", "m", "m", "m"),
                    rows=list(_table(numbers[table], paper)),
                    left=2,
                )
            )
        found.append(
            Listing(
                caption=f"Paired over the subjects, true means, and least true distances; {where}. "
                "95 % bootstrap interval of the mean difference. The paper gives no intervals; its "
                "difference stands beside. An arm that is kept from a way point waits before it "
                "for up to 10 s, one that gets there turns back to the far one: a mean over time "
                "pays for waiting.",
                names=(
                    "row",
                    "comparison",
                    "pairs",
                    "difference",
                    "95 % from",
                    "to",
                    "above 0",
                    "paper",
                ),
                units=("", "", "", "mm", "mm", "mm", "%", "mm"),
                rows=[
                    *_paired(numbers["paired_mm"], paper),
                    *_paired(numbers["paired_least_mm"], {}, "{}, least"),
                ],
                left=2,
            )
        )
        found.append(
            Listing(
                caption=f"Close calls; {where}. Too close: true distance under 0.05 m. Blind: "
                "then the cloud's nearest point was more than 0.05 m farther away than the human, "
                "or there was none.",
                names=(
                    "controller",
                    "trials",
                    "too close",
                    "ticks",
                    "blind",
                    "ticks",
                    "least",
                    "empty cloud",
                    "held",
                ),
                units=(
                    "",
                    "",
                    "trials",
                    "ticks",
                    "trials",
                    "ticks",
                    "m",
                    "% of ticks",
                    "% of ticks",
                ),
                rows=list(_close(numbers["close_calls"])),
                left=1,
            )
        )
    names = list(summary["close_calls"])
    found.append(
        Listing(
            caption="Settings: one set for all controllers. They differ in the control point "
            "alone (sm: the sensors' mounting points), in what they are given (wb_known: points "
            "of the human itself) and in what they remember (wb_memory).",
            names=("setting", *names),
            units=("", *("" for _ in names)),
            rows=[
                *(
                    (f"{key} [{unit}]" if unit else key, *(_setting(summary, key) for _ in names))
                    for key, unit in _SETTINGS
                ),
                ("x_o of eq. (4)", *(_velocity(summary, name) for name in names)),
            ],
            left=1,
        )
    )
    return found


def _layouts(summary: Summary) -> Iterator[tuple[str, Summary]]:
    yield "main", summary
    if summary["jittered"] is not None:
        yield "jittered", summary["jittered"]


def _table(table: Mapping[str, Any], paper: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    for row, controllers in table.items():
        for name, cell in controllers.items():
            mean, sigma = paper.get(row, {}).get(name, (None, None))
            apart = "-"
            if mean is not None and cell["seen_mean_m"] is not None:
                apart = f"{cell['seen_mean_m'] - mean:+.3f}"
            yield (
                name, _ROWS.get(row, row), in_metres(cell["seen_mean_m"]),
                in_metres(cell["seen_sigma_max_m"]), in_metres(mean), in_metres(sigma), apart,
                in_metres(cell["mean_m"]), in_metres(cell["sigma_max_m"]),
            )  # fmt: skip


def _paired(
    paired: Mapping[str, Any], paper: Mapping[str, Any], form: str = "{}"
) -> Iterator[tuple[str, ...]]:
    for row, comparisons in paired.items():
        for name, pair in comparisons.items():
            one, other = name.split("-")
            cell = paper.get(row, {})
            printed = "-"
            if one in cell and other in cell:
                printed = f"{1000.0 * (cell[one][0] - cell[other][0]):+.0f}"
            lengths = (f"{pair[key]:+.1f}" for key in ("mean", "low", "high"))
            yield (
                form.format(_ROWS.get(row, row)), f"{one} - {other}", str(pair["pairs"]), *lengths,
                f"{100.0 * pair['positive_share']:.0f}", printed,
            )  # fmt: skip


def _close(calls: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    for name, numbers in calls.items():
        yield (
            name, str(numbers["trials"]), str(numbers["too_close_trials"]),
            str(numbers["too_close_ticks"]), str(numbers["blind_trials"]),
            str(numbers["blind_ticks"]), in_metres(numbers["true_min_m"]),
            *(f"{100.0 * numbers[key] / max(numbers['ticks'], 1):.1f}"
              for key in ("empty_ticks", "held_ticks")),
        )  # fmt: skip


def _setting(summary: Summary, key: str) -> str:
    value = summary["settings"][key]
    return " > ".join(value) if isinstance(value, list) else f"{value:g}"


def _velocity(summary: Summary, name: str) -> str:
    """Where a controller has the obstacle's velocity from."""
    if name == "wb_known":
        return "known"
    return "estimated" if name in summary["settings"]["motion"]["controllers"] else "0"


def verdicts(summary: Summary) -> list[str]:
    """What holds of the experiment's bounds and what does not; what else is to be known."""
    told: list[str] = []
    for layout, numbers in _layouts(summary):
        told += _apart(summary, layout, numbers)
        for what, holds, figures in held(numbers, compared(summary)):
            word = "holds" if holds else "DOES NOT HOLD"
            if summary["subjects"] < _FEW:
                word = "too few subjects for a verdict"
            told.append(f"{layout}: {what}: {word} ({figures}).")
        calls = numbers["close_calls"]
        for name in ("wb", "sm"):
            if calls.get(name, {}).get("too_close_trials"):
                c = calls[name]
                told.append(
                    f"{layout}: {name} came under 0.05 m in {c['too_close_trials']} of "
                    f"{c['trials']} trials, {c['too_close_ticks']} ticks, of which "
                    f"{c['blind_ticks']} in a blind spot (the paper saw two such failures in 80 "
                    "trials)."
                )
    if summary["not_finite"] or summary["limits_violated"]:
        told.append(
            f"Trials with a command that is not finite: {summary['not_finite']}; with a violated "
            f"joint limit: {summary['limits_violated']}."
        )
    elif summary["close_calls"]:
        told.append("No command was not finite, none violated a joint limit.")
    if summary["self_under_limit"]:
        told.append(
            f"Trials in which the arm came within {SELF_LIMIT_M} m of itself: "
            f"{summary['self_under_limit']}; no law here avoids the own arm."
        )
    if summary["subjects"] < _FEW:
        told.append(
            f"With fewer than {_FEW} subjects there is no verdict: their intervals say little "
            "about others, however narrow."
        )
    redrawn = ", ".join(f"{reason} {n}" for reason, n in summary["redrawn"].items())
    told.append(
        f"{counted(summary['subjects'], 'subject')}. "
        + (f"Moved cells drawn again: {redrawn or 'none'}. " if summary["jittered"] else "")
        + f"One core simulated {summary['simulated_s'] / max(summary['wall_s'], 1e-9):.1f} times "
        "faster than real time."
    )
    return told


def _apart(summary: Summary, layout: str, numbers: Summary) -> Iterator[str]:
    """A sentence for every row in which both of the paper's controllers were met."""
    paper = compared(summary)
    for what, rows in (("mean", numbers["paired_mm"]), ("least", numbers["paired_least_mm"])):
        for row, comparisons in rows.items():
            pair = comparisons.get("wb-sm")
            if pair is None:
                continue
            text = (
                f"{pair['mean']:+.1f} mm, 95 % interval {pair['low']:+.1f} to {pair['high']:+.1f}"
            )
            if what == "mean" and row in paper:
                text += f"; the paper's {1000.0 * (paper[row]['wb'][0] - paper[row]['sm'][0]):+.0f}"
            side = "wb and sm are not told apart"
            if summary["subjects"] < _FEW:
                side = f"{counted(pair['pairs'], 'pair')}, too few to tell wb and sm apart"
            elif pair["low"] > 0.0 or pair["high"] < 0.0:
                side = f"wb is {'farther off' if pair['low'] > 0.0 else 'nearer'} than sm"
            yield f"{layout}: {_ROWS.get(row, row)}, {what} true distance: {side} ({text})."


def introduction(summary: Summary) -> str:
    """What was done, and what each controller that ran moves and is given."""
    names = list(summary["close_calls"])
    cells = "in the cell as it is"
    if summary["jittered"]:
        cells = "once in the cell as it is and once with all its positions moved at random"
    recorded = ", ".join(summary.get("recordings", ()))
    who = (
        f"The person recorded in {recorded} moves"
        if recorded
        else ("Virtual subjects walk in, fetch tools and assemble at a car door")
    )
    told = [
        f"{who} while the arm goes back and forth. Every controller meets the same subjects with "
        f"the same noise of the sensors, {cells}."
    ]
    if any(key not in compared(summary) for key in _rows(summary)):
        told.append(
            "The paper's figures stand beside those rows alone whose cell is the paper's, "
            "hri_task1 or hri_task2 as they are built in."
            if compared(summary)
            else "No row is compared with the paper: none of these cells is hri_task1 or hri_task2 "
            "as they are built in."
        )
    told += [f"{text}." for name, text in _MOVES.items() if name in names]
    return " ".join([*told, "Engineering figures from a simulation, not a certificate."])


def _rows(summary: Summary) -> list[str]:
    return [*summary["table1"], *summary["table2"]]


_MOVES = {
    "wb": "wb moves the nearest point of the whole arm",
    "sm": "sm moves only the sensors' mounting points",
    "wb_known": "wb_known is wb on points of the human itself, the ceiling, not a result of ours",
    "wb_memory": "wb_memory is wb that remembers what left the sensors' view",
}


def _moving(summary: Summary) -> str:
    """Which trials the moving picture shows."""
    trials = summary.get("moving")
    if not trials:
        return "One of the trials"
    names = " and ".join(trial["controller"] for trial in trials)
    recorded = summary.get("recordings")
    whose = ", ".join(recorded) if recorded else f"subject {trials[0]['subject']}"
    return f"{_ROWS.get(trials[0]['task'], trials[0]['task'])}, {whose}, {names}"


def captions(summary: Summary) -> dict[str, str]:
    """What the figures show."""
    paper = bool(compared(summary))
    moved = "in the cell as it is and in moved ones" if summary["jittered"] else "of each row"
    return {
        "trials.png": "The form of [WA] Fig. 9: least distance and activation of the avoidance "
        "over time, the same subject at the same task, (a) sensor points, (b) whole body. Solid: "
        "seen. Dashed: true. Vertical: the signals. Dotted: the thresholds between which the "
        "activation rises. Filled: nothing was in view.",
        "cycles.png": "Least true distance over the cycle: mean over the subjects and, of WB and "
        "SM, one standard deviation to either side; vertical: the signals.",
        "subjects.png": "Each subject's mean true distance (dots), task by task, phase by phase; "
        "bars: means over the subjects; diamonds: means of what was seen"
        + ("; crosses: the paper's, seen ones too." if paper else "."),
        "differences.png": "Paired differences of the true means, subject by subject (dots), with "
        f"their mean and its 95 % bootstrap interval, {moved}"
        + ("; crosses: the paper's difference." if paper else "."),
        "motion.gif": f"{_moving(summary)}, in motion: red, the filtered cloud; blue, points that "
        "were taken for the arm itself and removed; green, the pair that the avoidance acts on; "
        "axes, the way point that is due.",
    }

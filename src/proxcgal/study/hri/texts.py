"""Texts of the human study: verdicts, introduction, captions."""

from collections.abc import Iterator

from proxcgal.core.tables import counted
from proxcgal.evaluation.metrics import SELF_LIMIT_M, Summary
from proxcgal.study.hri.metrics import compared, held
from proxcgal.study.hri.paper_tables import ROW_NAMES, layouts

_FEW = 6  # subjects: fewer give no verdict


def verdicts(summary: Summary) -> Iterator[str]:
    """What holds of the experiment's bounds and what does not; what else is to be known."""
    for layout, numbers in layouts(summary):
        yield from _apart(summary, layout, numbers)
        for what, holds, figures in held(numbers, compared(summary)):
            word = "holds" if holds else "DOES NOT HOLD"
            if summary["subjects"] < _FEW:
                word = "too few subjects for a verdict"
            yield f"{layout}: {what}: {word} ({figures})."
        calls = numbers["close_calls"]
        for name in ("wb", "sm"):
            if calls.get(name, {}).get("too_close_trials"):
                c = calls[name]
                yield (
                    f"{layout}: {name} came under 0.05 m in {c['too_close_trials']} of "
                    f"{c['trials']} trials, {c['too_close_ticks']} ticks, of which "
                    f"{c['blind_ticks']} in a blind spot (the paper saw two such failures in 80 "
                    "trials)."
                )
    if summary["not_finite"] or summary["limits_violated"]:
        yield (
            f"Trials with a command that is not finite: {summary['not_finite']}; with a violated "
            f"joint limit: {summary['limits_violated']}."
        )
    elif summary["close_calls"]:
        yield "No command was not finite, none violated a joint limit."
    if summary["self_under_limit"]:
        yield (
            f"Trials in which the arm came within {SELF_LIMIT_M} m of itself: "
            f"{summary['self_under_limit']}; no law here avoids the own arm."
        )
    if summary["subjects"] < _FEW:
        yield (
            f"With fewer than {_FEW} subjects there is no verdict: their intervals say little "
            "about others, however narrow."
        )
    redrawn = ", ".join(f"{reason} {n}" for reason, n in summary["redrawn"].items())
    yield (
        f"{counted(summary['subjects'], 'subject')}. "
        + (f"Moved cells drawn again: {redrawn or 'none'}. " if summary["jittered"] else "")
        + f"One core simulated {summary['simulated_s'] / max(summary['wall_s'], 1e-9):.1f} times "
        "faster than real time."
    )


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
            yield f"{layout}: {ROW_NAMES.get(row, row)}, {what} true distance: {side} ({text})."


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
    sentences = [
        f"{who} while the arm goes back and forth. Every controller meets the same subjects with "
        f"the same noise of the sensors, {cells}."
    ]
    if any(
        key not in compared(summary) for table in ("table1", "table2") for key in summary[table]
    ):
        sentences.append(
            "The paper's figures stand beside those rows alone whose cell is the paper's, "
            "hri_task1 or hri_task2 as they are built in."
            if compared(summary)
            else "No row is compared with the paper: none of these cells is hri_task1 or hri_task2 "
            "as they are built in."
        )
    sentences += [f"{text}." for name, text in _MOVES.items() if name in names]
    return " ".join([*sentences, "Engineering figures from a simulation, not a certificate."])


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
    return f"{ROW_NAMES.get(trials[0]['task'], trials[0]['task'])}, {whose}, {names}"


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

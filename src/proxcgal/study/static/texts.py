"""Texts of the drawn static scenes: tables, verdicts, captions."""

from collections.abc import Iterator

from proxcgal.core.tables import in_metres
from proxcgal.evaluation.metrics import SELF_LIMIT_M, Summary
from proxcgal.study.bootstrap import ENOUGH
from proxcgal.study.campaign import Listing, file_name
from proxcgal.study.static.memory_share import memory_rows, memory_sentences


def listings(summary: Summary) -> list[Listing]:
    """A row a controller and scene, then a row a comparison."""
    rows, pairs, seen, memory = [], [], [], []
    for scene, found in summary["scenes"].items():
        for name, numbers in found["controllers"].items():
            rows.append((scene, name, *_cells(numbers)))
            shares = [*(numbers.get("closest_points") or {}).values()]
            if shares and None not in shares:
                seen.append((scene, name, *(f"{100.0 * share:.0f}" for share in shares)))
        memory += memory_rows(scene, found["memory"])
        for name in ("gain_mm", "sensing_cost_mm"):
            pairs.append((scene, _COMPARISONS[name], *_pair_cells(found[name])))
    return [
        Listing(
            caption="True distance to the panel: medians over the draws, with the 5 % quantile "
            "and the least. Final: mean of the last 2 s. Too close: trials that came under 0.05 m "
            "of it. Unseen: those of them in which the cloud's nearest point was then more than "
            "0.05 m farther away than the panel. Own links: the least of all trials.",
            names=("scene", "controller", "trials", "min", "5 %", "least", "final", "5 %",
                   "too close", "unseen", "own links"),
            units=("", "", "", "m", "m", "m", "m", "m", "trials", "trials", "m"),
            rows=rows, left=2,
        ),
        Listing(
            caption="Paired over the draws, true distance at the end: median with its 95 % "
            "bootstrap interval, 5 % and 95 % quantiles, share of draws above 0.",
            names=("scene", "comparison", "pairs", "median", "95 % from", "to", "5 %", "95 %",
                   "above 0"),
            units=("", "", "", "mm", "mm", "mm", "mm", "mm", "%"),
            rows=pairs, left=2,
        ),
        Listing(
            caption="What the sensors had of the truly closest points, mean over the draws: in "
            "view at the last scan, within the memory's time before, longer ago, never.",
            names=("scene", "controller", "in view", "remembered", "forgotten", "never seen"),
            units=("", "", "%", "%", "%", "%"),
            rows=seen, left=2,
        ),
        Listing(
            caption="What memory gives back of what sensing costs, true distance: means over the "
            "draws, share of the sums with its 95 % bootstrap interval, draws that it brings "
            "nearer by more than 20 mm.",
            names=("scene", "distance", "draws", "lost", "regained", "closed", "95 % from", "to",
                   "worse"),
            units=("", "", "", "mm", "mm", "%", "%", "%", "draws"),
            rows=memory, left=2,
        ),
    ]  # fmt: skip


_COMPARISONS = {"gain_mm": "gain, wb - sm", "sensing_cost_mm": "sensing, wb_known - wb"}


def _cells(numbers: Summary) -> tuple[str, ...]:
    if not numbers["trials"]:
        return ("0", *"--------")
    low, final = numbers["true_min_m"], numbers["true_final_m"]
    return (
        str(numbers["trials"]),
        *(in_metres(low[key]) for key in ("median", "p5", "min")),
        *(in_metres(final[key]) for key in ("median", "p5")),
        str(numbers["violating_trials"]),
        str(numbers["unseen_trials"]),
        in_metres(numbers["self_min_m"]),
    )


def _pair_cells(paired: Summary | None) -> tuple[str, ...]:
    if paired is None:
        return ("0", *"------")
    lengths = (f"{paired[key]:+.0f}" for key in ("median", "low", "high", "p5", "p95"))
    return (str(paired["pairs"]), *lengths, f"{100.0 * paired['positive_share']:.0f}")


def verdicts(summary: Summary) -> Iterator[str]:
    """What the numbers say, a sentence a scene; then what was drawn again, and own links."""
    for scene, found in summary["scenes"].items():
        gain, cost = found["gain_mm"], found["sensing_cost_mm"]
        if gain is not None:
            text = (
                f"{scene}: wb ends {gain['median']:+.0f} mm farther away than sm in the median "
                f"({_sureness(gain)})"
            )
            if cost is not None:
                text += f"; sensing costs wb {cost['median']:.0f} mm against a known scene"
            yield text + "."
        ours = found["controllers"].get("wb", {})
        if ours.get("violating_trials"):
            yield (
                f"{scene}: wb came under 0.05 m in {ours['violating_trials']} of {ours['trials']} "
                f"trials, in {ours['unseen_trials']} of them unseen: the cloud showed nothing that "
                "near."
            )
        yield from memory_sentences(scene, found["memory"])
        again = ", ".join(f"{reason} {count}" for reason, count in found["redrawn"].items())
        yield f"{scene}: {found['draws']} draws; drawn again: {again or 'none'}."
    if summary["self_under_limit"]:
        yield (
            f"Trials in which the arm came within {SELF_LIMIT_M} m of itself: "
            f"{summary['self_under_limit']}. By the rule of single runs these have failed; they "
            "are counted all the same: no law here avoids the own arm."
        )


def _sureness(paired: Summary) -> str:
    if paired["pairs"] < ENOUGH:
        return f"{paired['pairs']} draws: too few to say how sure that is"
    sure = paired["low"] > 0.0 or paired["high"] < 0.0
    return (
        f"95 % interval {paired['low']:+.0f} to {paired['high']:+.0f} mm, which "
        f"{'excludes' if sure else 'includes'} 0"
    )


def captions(summary: Summary) -> dict[str, str]:
    """What the figures show."""
    kinds = ((".png", _CAPTION), ("_memory.png", _MEMORY_CAPTION))
    return {
        file_name(scene + ending): f"{scene}: {caption}"
        for scene in summary["scenes"]
        for ending, caption in kinds
    }


_MEMORY_CAPTION = (
    "what memory gives back of what sensing costs, each draw a point: how much farther away "
    "wb_memory stays than wb, over how much farther wb_known does. On the diagonal memory makes up "
    "for all that sensing costs, on the level line for nothing; below the dotted line it brings "
    "the arm nearer by more than 20 mm."
)
_CAPTION = (
    "random panels, start postures and goals. (a) Share of the draws that end nearer to the panel "
    "than a distance, per controller; dotted: 0.05 m, under which a tick is a violation. (b) Each "
    "draw's true distance at the end, wb over sm: above the diagonal the whole body keeps farther "
    "away. (c) Share of the draws whose difference is smaller: what wb gains over sm, and what a "
    "known scene would give on top; bands: 95 % bootstrap intervals of the medians."
)

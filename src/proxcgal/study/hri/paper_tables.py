"""The human study's tables: the paper's Tables I and II beside ours, and what lies behind."""

from collections.abc import Iterator, Mapping
from typing import Any

from proxcgal.core.tables import in_metres
from proxcgal.evaluation.metrics import Summary
from proxcgal.study.campaign import Listing
from proxcgal.study.hri.metrics import compared

_LAYOUTS = {"main": "the cell as it is", "jittered": "all positions moved by up to 0.1 m"}
ROW_NAMES = {
    "task1": "Assembly Task 1", "task2": "Assembly Task 2", "H1": "Assembly Operation on H1",
    "H2": "Assembly Operation on H2", "H3_first": "Assembly Operation on H3 (first run)",
    "H3_second": "Assembly Operation on H3 (second run)",
}  # fmt: skip
_SETTINGS = (
    ("d_min", "m"), ("buffer", "m"), ("avoid_gain", "1/s"), ("nearest", ""), ("reach_gain", "1/s"),
    ("max_linear", "m/s"), ("max_angular", "rad/s"), ("tasks", ""),
)  # fmt: skip


def listings(summary: Summary) -> Iterator[Listing]:
    """Tables I and II beside the paper's, differences, close calls, settings."""
    paper = compared(summary)
    for layout, numbers in layouts(summary):
        where = _LAYOUTS[layout]
        for table, title in (("table1", "Table I, whole cycles"), ("table2", "Table II, phases")):
            if not numbers[table]:
                continue
            yield Listing(
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
        yield Listing(
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
        yield Listing(
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
    names = list(summary["close_calls"])
    yield Listing(
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


def layouts(summary: Summary) -> Iterator[tuple[str, Summary]]:
    """Numbers of the cell as it is and, where it was moved too, of the moved ones, by name."""
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
                name, ROW_NAMES.get(row, row), in_metres(cell["seen_mean_m"]),
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
                form.format(ROW_NAMES.get(row, row)), f"{one} - {other}", str(pair["pairs"]),
                *lengths, f"{100.0 * pair['positive_share']:.0f}", printed,
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

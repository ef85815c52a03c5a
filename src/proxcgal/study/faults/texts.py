"""What the faults' campaign amounts to, for people: table, sentences, caption, its page."""

from collections.abc import Iterator

from proxcgal.core import modes
from proxcgal.evaluation.metrics import Summary
from proxcgal.study.campaign import Listing
from proxcgal.study.faults.cases import ROW_OF, ROWS, TICK_MS, Row
from proxcgal.study.faults.reliability_page import reliability_page, whole_ms


def listings(summary: Summary) -> list[Listing]:
    """Row, robot, runs, right mode, latency, worst."""
    rows = [
        (
            name, robot, _required(row := ROW_OF[name]), str(found["runs"]), str(found["right"]),
            whole_ms(found["latency_median_ms"]), whole_ms(found["latency_max_ms"]),
            f"{1000 * row.within:.0f} + {TICK_MS}" if row.least > modes.RUN else "-",
            ", ".join(f"{mode} {n}" for mode, n in found["worst_modes"].items()),
        )
        for robot, own in summary["robots"].items()
        for name, found in own.items()
    ]  # fmt: skip
    return [
        Listing(
            caption="Every fault lasts 0.6 s (one missed deadline, a joint state that is not a "
            "number: a tick) and begins at a random "
            "moment, at a random sensor. Right: the required mode in time and no other, the "
            "finding told, the arm free again 0.7 s after the fault; where no command may change, "
            "the same commands as without it, to the bit. Latency from the fault's onset, told at "
            "the next tick (10 ms).",
            names=("fault", "robot", "required", "runs", "right", "median", "worst", "bound",
                   "farthest mode"),
            units=("", "", "", "", "", "ms", "ms", "ms", "runs"),
            rows=rows, left=3,
        )
    ]  # fmt: skip


def _required(row: Row) -> str:
    if row.refused:
        return "refused"
    if row.least == row.most:
        return modes.NAMES[row.least]
    return f"{modes.NAMES[row.least]} or {modes.NAMES[row.most]}"


def verdicts(summary: Summary) -> Iterator[str]:
    """How many were right, and which rows were not."""
    wrong = [
        f"{name} on {robot} ({found['right']} of {found['runs']})"
        for robot, rows in summary["robots"].items()
        for name, found in rows.items()
        if found["right"] < found["runs"]
    ]
    runs = sum(found["runs"] for rows in summary["robots"].values() for found in rows.values())
    yield f"The behaviour was right in {summary['right']} of {runs} runs."
    if wrong:
        yield "Not always right: " + "; ".join(wrong) + "."


def captions(summary: Summary) -> dict[str, str]:
    """What the figure shows."""
    return {
        "latency.png": "Time from the fault's onset to the required mode, one dot a run, in the "
        f"colour of that mode; grey: the bound, which may be passed by a tick of {TICK_MS} ms."
    }


def pages(summary: Summary) -> dict[str, str]:
    """What docs/reliability.md is a copy of."""
    required = {row.name: _required(row) for row in ROWS}
    return {"reliability.md": reliability_page(ROWS, summary, required)}

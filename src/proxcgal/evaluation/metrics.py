"""The numbers of `summary.json`, and files that are whole or not there."""

from __future__ import annotations

import json
import math
import os
import tempfile
from collections.abc import Mapping, Sequence
from numbers import Integral
from pathlib import Path
from typing import Any

from proxcgal.core.errors import ConfigError
from proxcgal.evaluation.trial_log import NOTHING, TrialLog

Summary = dict[str, Any]

NOTHING_M = NOTHING  # [m] how a distance to nothing is written
SELF_LIMIT_M = 0.02  # [m] a run whose own links come nearer than this has failed
CONTROLLER_KEYS = (
    "true_min_m",
    "true_final_m",
    "seen_min_m",
    "goal_error_m",
    "violations",
    "self_min_m",
)


#: What of the closest points could be known, see `evaluation.coverage`.
COVERAGE_KEYS = ("in_view_share", "remembered_share", "forgotten_share", "never_seen_share")


def static_summary(logs: Sequence[TrialLog]) -> Summary:
    """Numbers of one scenario, all its controllers: the content of its `summary.json`.

    Args:
        logs: one trial per controller, all of the same scenario, robot and seed.

    Returns:
        `scenario`, `robot`, `seed`, `controllers` (per controller: least true distance [m], true
        distance at the end [m] (mean of the last 2 s), least seen distance [m], goal error at the
        end [m], violations (ticks with a true distance under 0.05 m), least distance between own
        links [m]), `closest_points` (per controller: what shares of the truly closest points the
        sensors had in view, see `evaluation.coverage`), `gain_mm` (true distance at the end,
        wb over sm; None where one did not run), `self_min_m` of all trials and `failed`, true where
        that is under 0.02 m. What does not apply is None, a distance to nothing 9.99.

    Raises:
        ConfigError: no log, logs of different scenarios, robots or seeds, a controller twice.
    """
    if not logs:
        raise ConfigError("summary: no trial given, at least one is needed")
    for field in ("scenario", "robot", "seed"):
        found = sorted({str(getattr(log, field)) for log in logs})
        if len(found) > 1:
            raise ConfigError(f"summary: trials of one {field} expected, got {', '.join(found)}")
    names = [log.controller for log in logs]
    if len(set(names)) < len(names):
        raise ConfigError(f"summary: each controller once expected, got {', '.join(names)}")

    controllers = {}
    for log in logs:
        numbers = log.summary()
        controllers[log.controller] = {key: finite(numbers.get(key)) for key in CONTROLLER_KEYS}
    own = [c["self_min_m"] for c in controllers.values() if c["self_min_m"] is not None]
    self_min = min(own, default=None)
    return {
        "scenario": logs[0].scenario,
        "robot": logs[0].robot,
        "seed": int(logs[0].seed),
        "controllers": controllers,
        "closest_points": {
            log.controller: {key: finite(share) for key, share in log.coverage.numbers().items()}
            for log in logs
        },
        "gain_mm": gain_mm(controllers),
        "self_min_m": self_min,
        "failed": self_min is not None and self_min < SELF_LIMIT_M,
    }


def gain_mm(controllers: Mapping[str, Mapping[str, float | None]]) -> float | None:
    """How much farther wb ends from the obstacle than sm, truly [mm]; None where one is missing."""
    ends = [controllers.get(name, {}).get("true_final_m") for name in ("wb", "sm")]
    if ends[0] is None or ends[1] is None or NOTHING_M in ends:
        return None
    return 1000.0 * (ends[0] - ends[1])


def combined(summaries: Sequence[Summary]) -> Summary:
    """Several scenarios' summaries as one: by name, with the worst `self_min_m` of all."""
    own = [s["self_min_m"] for s in summaries if s["self_min_m"] is not None]
    return {
        "scenarios": {s["scenario"]: s for s in summaries},
        "self_min_m": min(own, default=None),
        "failed": any(s["failed"] for s in summaries),
    }


def table(summaries: Sequence[Summary]) -> str:
    """The summaries as a table for a terminal: a line a trial, distances in metres.

    Ticks under 0.05 m have a column where there are any.
    """
    head = ["scenario", "controller", "true min", "true final", "seen min", "goal error", "gain"]
    units = ["", "", "[m]", "[m]", "[m]", "[m]", "[mm]"]
    numbers_of = [n for summary in summaries for n in summary["controllers"].values()]
    violated = any(numbers["violations"] for numbers in numbers_of)
    if violated:
        head.insert(6, "violations")
        units.insert(6, "[ticks]")
    rows = [head, units]
    for summary in summaries:
        for name, numbers in summary["controllers"].items():
            gain = summary["gain_mm"] if name == "wb" else None
            cells = [shown(numbers[key]) for key in CONTROLLER_KEYS[:4]]
            if violated:
                cells.append("-" if numbers["violations"] is None else str(numbers["violations"]))
            last = "" if gain is None else f"{gain:+.0f}"
            rows.append([summary["scenario"], name, *cells, last])
    return aligned(rows, left=2, heads=2)


def coverage_lines(scene: str, controllers: Mapping[str, Mapping[str, float | None]]) -> list[str]:
    """What the sensors had of the truly closest points, a line a controller that was asked."""
    lines = []
    for name, numbers in controllers.items():
        shares = [numbers.get(key) for key in COVERAGE_KEYS]
        percent = [100.0 * share for share in shares if share is not None]
        if len(percent) == len(shares):
            lines.append(
                f"{scene}, {name}: of the truly closest points {percent[0]:.0f} % were in view, "
                f"{percent[1]:.0f} % within the memory's time before, {percent[2]:.0f} % earlier, "
                f"{percent[3]:.0f} % never"
            )
    return lines


def aligned(rows: Sequence[Sequence[str]], *, left: int, heads: int) -> str:
    """Rows as lines of columns: the first `left` flush left, a rule below the first `heads`."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = []
    for row in rows:
        cells = [
            cell.ljust(width) if column < left else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    lines.insert(heads, "-" * max(map(len, lines)))
    return "\n".join(lines)


def counted(number: int, noun: str) -> str:
    """A count for a reader: "1 subject", "2 subjects"."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def shown(value: float | None) -> str:
    """A length for a reader [m]: millimetre digits, a dash where there is none."""
    if value is None:
        return "-"
    return "none" if value >= NOTHING_M else f"{value:.3f}"


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Strict JSON (no NaN), whole or not at all: written beside and moved into place.

    Raises: as `as_json`.
    """
    write_bytes(path, as_json(content))


def as_json(content: Mapping[str, Any]) -> bytes:
    """Strict JSON (no NaN), as a file's bytes.

    Raises:
        ValueError: a number that is not finite, which JSON cannot hold.
    """
    text = json.dumps(content, indent=2, allow_nan=False, default=_plain)
    return (text + "\n").encode()


def write_text(path: Path, text: str) -> None:
    """A file that is whole or not there: readers never meet half of it."""
    write_bytes(path, text.encode())


def write_bytes(path: Path, content: bytes) -> None:
    """A file that is whole or not there, and on the disk once this returns.

    Raises:
        OSError: it cannot be written; with its name, where the disk is full too.
    """
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(name).chmod(0o644)  # mkstemp makes it private
        Path(name).replace(path)
    except BaseException as error:
        Path(name).unlink(missing_ok=True)
        if isinstance(error, OSError):
            error.filename = str(path)
        raise
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)  # the name too
    finally:
        os.close(folder)


def finite(value: Any) -> float | int | None:
    """A finite plain number: None for NaN, 9.99 for a distance to nothing."""
    if value is None:
        return None
    if isinstance(value, Integral):
        return int(value)
    number = float(value)
    if math.isnan(number):
        return None
    return NOTHING_M if math.isinf(number) else number


def _plain(value: Any) -> Any:
    """NumPy numbers and arrays as JSON has them."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no form in JSON")

"""The numbers of `summary.json`, and files that are whole or not there."""

from collections.abc import Mapping, Sequence
from typing import Any

from proxcgal.core.errors import ConfigError
from proxcgal.core.files import NOTHING_M, finite
from proxcgal.core.tables import aligned, in_metres
from proxcgal.evaluation.trial_log import TrialLog

Summary = dict[str, Any]

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
            cells = [in_metres(numbers[key]) for key in CONTROLLER_KEYS[:4]]
            if violated:
                cells.append("-" if numbers["violations"] is None else str(numbers["violations"]))
            cells.append("" if gain is None else f"{gain:+.0f}")
            rows.append([summary["scenario"], name, *cells])
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

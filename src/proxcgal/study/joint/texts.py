"""Texts of the runs of the 12-joint robot: tables, verdicts, captions."""

from collections.abc import Iterator, Sequence
from statistics import median
from typing import Any

from proxcgal.core.files import NOTHING_M
from proxcgal.core.tables import capitalised, in_metres
from proxcgal.evaluation.metrics import SELF_LIMIT_M, Summary
from proxcgal.evaluation.trial_log import TOO_CLOSE
from proxcgal.study.campaign import Listing, file_name

Run = dict[str, Any]

PERCEPTION_NAMES = {
    "known": "known",
    "sensed": "sensed, forearm rings",
    "sensed_2nd_set": "sensed, with the KUKA's rings",
    "memory": "sensed with memory",
    "memory_2nd_set": "sensed with memory, with the KUKA's rings",
}
_STACK_NAMES = {
    "thesis": "The thesis's stack (no joint limits, altitude before avoidance)",
    "no_joint_limits": "Without joint_limits",
    "no_avoidance": "Without avoidance",
    "no_minimum_altitude": "Without minimum_altitude",
    "with_self_collision": "With self_collision added",
    "with_manipulability": "With manipulability of both arms added",
}


def listings(summary: Summary) -> list[Listing]:
    """A row for each known run, then one for each way of sensing, start and scene."""
    runs = summary["runs"]
    known = [run for run in runs if run["perception"] == "known"]
    compared = _stack_text(_full(runs))
    return [
        Listing(
            caption="Known obstacles, each stack. End: reached (0.03 m, 0.05 rad, unless the file "
            "says otherwise), or what held the arm. True: least distance to the scene. Altitude: "
            "the tool's least. Limit: least distance of a joint to its limit. Dexterity: least "
            "manipulability of the KUKA and of the UR10e, as a share of each one's largest. Macro: "
            "share of the motion at the tool made by the KUKA. Own: least between own links.",
            names=("scene", "init", "stack", "end", "time", "error", "angle", "true", "altitude",
                   "limit", "dexterity, KUKA", "dexterity, UR10e", "macro", "own"),
            units=("", "", "", "", "s", "m", "rad", "m", "m", "rad", "-", "-", "%", "m"),
            rows=[_known_row(run) for run in known], left=4,
        ),
        Listing(
            caption=f"{capitalised(compared)} on known obstacles, and on what sensors see. "
            "Reached: "
            "runs that did. Least and median of the true distances. Too close: runs that came "
            "under 0.05 m; unseen: those of them in which the cloud's nearest point was then more "
            "than 0.05 m farther away than the obstacle. Link: the one that came nearest.",
            names=("scene", "init", "perception", "link", "runs", "reached", "least", "median",
                   "too close", "unseen"),
            units=("", "", "", "", "", "runs", "m", "m", "runs", "runs"),
            rows=list(_sensed_rows(runs)), left=4,
        ),
    ]  # fmt: skip


def _known_row(run: Run) -> tuple[str, ...]:
    end = "reached" if run["succeeded"] else run["holds_task"] or "no progress"
    return (
        run["scenario"], run["init"], run["stack"], end,
        f"{run['time_s']:.1f}", f"{run['position_error_m']:.3f}", f"{run['angle_error_rad']:.3f}",
        in_metres(run["true_min_m"]), f"{run['min_altitude_m']:.3f}",
        f"{run['limit_margin_rad']:.2f}",
        f"{run['manipulability_macro']:.3f}", f"{run['manipulability_micro']:.3f}",
        f"{100.0 * run['macro_share']:.0f}", in_metres(run["self_min_m"]),
    )  # fmt: skip


def _sensed_rows(runs: Sequence[Run]) -> Iterator[tuple[str, ...]]:
    for (scene, init, perception), own in _grouped(_full(runs), "scenario", "init", "perception"):
        nearest = min(own, key=lambda run: run["true_min_m"])
        if nearest["true_min_m"] >= NOTHING_M and perception != "known":
            continue  # nothing to see
        close = [run for run in own if run["true_min_m"] < TOO_CLOSE]
        yield (
            scene, init, PERCEPTION_NAMES.get(perception, perception), nearest["true_min_link"],
            str(len(own)), str(_reached(own)), in_metres(nearest["true_min_m"]),
            in_metres(median(run["true_min_m"] for run in own)), str(len(close)),
            str(_unseen(close)),
        )  # fmt: skip


def verdicts(summary: Summary) -> Iterator[str]:
    """What each task costs and buys, what sensing costs, what held the arm; from the numbers."""
    runs = summary["runs"]
    for about in (_endings, _macro, _tasks, _sensing, _second_set):
        yield from about(runs)
    if summary["self_under_limit"]:
        close = sorted({_where(run) for run in runs if run["self_min_m"] < SELF_LIMIT_M})
        yield (
            f"Runs in which the robot came within {SELF_LIMIT_M} m of itself: "
            f"{summary['self_under_limit']}; by the rule of single runs these have failed: "
            f"{', '.join(close)}."
        )


def _endings(runs: Sequence[Run]) -> Iterator[str]:
    known = [run for run in _full(runs) if run["perception"] == "known"]
    if not known:
        return
    reached = [run for run in known if run["succeeded"]]
    yield (
        f"Known obstacles, {_stack_text(known)}: "
        f"{len(reached)} of {len(known)} runs reach the goal"
        + (f", in {_span(run['time_s'] for run in reached)} s" if reached else "")
        + "."
    )
    for run in known:
        if not run["succeeded"]:
            yield f"{run['scenario']} from {run['init']}: {run['outcome']}: {run['reason']}."


def _macro(runs: Sequence[Run]) -> Iterator[str]:
    for (init,), own in _grouped(
        [run for run in _full(runs) if run["perception"] == "known"], "init"
    ):
        shares = [100.0 * run["macro_share"] for run in own]
        yield (
            f"From {init} the KUKA makes {median(shares):.0f} % of the motion at the tool in the "
            f"median over the scenes ({_span(shares, 0)} %)."
        )


def _tasks(runs: Sequence[Run]) -> Iterator[str]:
    """Each stack beside the full one, over the same scenes and starts."""
    known = [run for run in runs if run["perception"] == "known"]
    full = {(run["scenario"], run["init"]): run for run in known if run["stack"] == "full"}
    for (stack,), own in _grouped(known, "stack"):
        pairs = [(run, full[run["scenario"], run["init"]]) for run in own
                 if (run["scenario"], run["init"]) in full]  # fmt: skip
        if stack == "full" or not pairs:
            continue
        both = [(a, b) for a, b in pairs if a["succeeded"] and b["succeeded"]]
        text = (
            f"{_STACK_NAMES.get(stack, stack)}: {_reached([a for a, _ in pairs])} of {len(pairs)} "
            f"runs reach the goal (full: {_reached([b for _, b in pairs])})"
        )
        if both:
            # + 0.0: "+0.0 s", never "-0.0 s"
            slower = round(median(a["time_s"] - b["time_s"] for a, b in both), 1) + 0.0
            text += f", {slower:+.1f} s in the median of those where both do"
        changes = [
            ("least true distance", "true_min_m", "m", 3),
            ("lowest tool", "min_altitude_m", "m", 3),
            ("nearest joint limit", "limit_margin_rad", "rad", 2),
            ("least between own links", "self_min_m", "m", 3),
            ("least manipulability of the UR10e", "manipulability_micro", "of its largest", 3),
        ]
        apart = []
        for name, key, unit, digits in changes:
            ours, other = min(a[key] for a, _ in pairs), min(b[key] for _, b in pairs)
            if min(ours, other) < NOTHING_M and abs(ours - other) >= 0.5 * 10.0**-digits:
                apart.append(f"{name} {ours:.{digits}f} {unit} (full: {other:.{digits}f})")
        yield text + ("; " + ", ".join(apart) if apart else "; nothing else changes") + "."


def _sensing(runs: Sequence[Run]) -> Iterator[str]:
    """How near every way of seeing came, where there is something to meet."""
    met = [run for run in _full(runs) if run["true_min_m"] < NOTHING_M]
    for (perception,), own in _grouped(met, "perception"):
        close = [run for run in own if run["true_min_m"] < TOO_CLOSE]
        nearest = min(own, key=lambda run: run["true_min_m"])
        text = (
            f"{capitalised(PERCEPTION_NAMES.get(perception, perception))}: {_reached(own)} of "
            f"{len(own)} runs reach the goal, {len(close)} come under {TOO_CLOSE} m of an obstacle"
        )
        if close:
            places = ", ".join(sorted({_where(run) for run in close}))
            text += (
                f" ({places}), {_unseen(close)} of them unseen: the cloud showed nothing that near"
            )
        yield (
            f"{text}; at the least {nearest['true_min_m']:.3f} m, by {nearest['true_min_link']} in "
            f"{_where(nearest)}."
        )


def _second_set(runs: Sequence[Run]) -> Iterator[str]:
    for one, two in (("sensed", "sensed_2nd_set"), ("memory", "memory_2nd_set")):
        by_run = {
            (run["perception"], run["scenario"], run["init"], run["seed"]): run
            for run in _full(runs) if run["true_min_m"] < NOTHING_M
        }  # fmt: skip
        pairs = [
            (run, by_run[two, *key[1:]])
            for key, run in by_run.items()
            if key[0] == one and (two, *key[1:]) in by_run
        ]
        if not pairs:
            continue
        gains = [1000.0 * (b["true_min_m"] - a["true_min_m"]) for a, b in pairs]
        close = [sum(run[side]["true_min_m"] < TOO_CLOSE for run in pairs) for side in (0, 1)]
        yield (
            f"A second set of sensors on the KUKA's arm ({PERCEPTION_NAMES[one]}): the least true "
            f"distance changes by {median(gains):+.0f} mm in the median ({_span(gains, 0)} mm), "
            f"runs under {TOO_CLOSE} m from {close[0]} to {close[1]} of {len(pairs)}."
        )


def _full(runs: Sequence[Run]) -> list[Run]:
    """Those of the full stack, which the others are compared with; of a run without it, its own."""
    stacks = [run["stack"] for run in runs]
    compared = "full" if "full" in stacks or not stacks else stacks[0]
    return [run for run in runs if run["stack"] == compared]


def _stack_text(runs: Sequence[Run]) -> str:
    """What stack these runs of one had."""
    stack = runs[0]["stack"] if runs else "full"
    return f"the {stack} stack" if stack in ("full", "thesis") else f"the stack of {stack}"


def _reached(runs: Sequence[Run]) -> int:
    return sum(bool(run["succeeded"]) for run in runs)


def _unseen(runs: Sequence[Run]) -> int:
    return sum(run["seen_at_true_min_m"] - run["true_min_m"] > TOO_CLOSE for run in runs)


def _where(run: Run) -> str:
    return f"{run['scenario']} from {run['init']}"


def _span(values: Any, digits: int = 1) -> str:
    found = list(values)
    return f"{min(found):.{digits}f} to {max(found):.{digits}f}"


def _grouped(runs: Sequence[Run], *keys: str) -> Iterator[tuple[tuple[str, ...], list[Run]]]:
    """Runs by the values of some keys, in the order of first appearance."""
    groups: dict[tuple[str, ...], list[Run]] = {}
    for run in runs:
        groups.setdefault(tuple(run[key] for key in keys), []).append(run)
    yield from groups.items()


def captions(summary: Summary) -> dict[str, str]:
    """What the figures show."""
    scenes = dict.fromkeys(run["scenario"] for run in summary["runs"] if run["stack"] == "full")
    return {f"{file_name(scene)}.png": f"{scene}: {_CAPTION}" for scene in scenes}


_CAPTION = (
    "the full stack from each initial configuration. Top: how fast each arm alone would move the "
    "tool, |J qd| of its own joints, obstacles known. Middle: the most active row of each task in "
    "the same run. Bottom: true distance from the robot to the scene, known, sensed, and sensed "
    "with memory (the first seed); a dot ends each run."
)

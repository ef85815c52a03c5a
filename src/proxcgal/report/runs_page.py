"""The HTML of a report on runs of scenes: tables, figures, findings."""

from collections.abc import Iterator, Sequence
from html import escape

from proxcgal.core.tables import capitalised, in_metres
from proxcgal.evaluation.metrics import COVERAGE_KEYS, SELF_LIMIT_M
from proxcgal.report.document import (
    Pictures,
    cell,
    document,
    head,
    listing_part,
    origin_part,
    recordings_part,
    table_part,
)
from proxcgal.report.replays import Replays
from proxcgal.report.stored_results import About, StoredNumbers, StoredRun
from proxcgal.study.campaign import Listing
from proxcgal.study.runs.pictures import SIDE_BY_SIDE

PICTURES = (
    (
        "distance.png",
        "Least distance between arm and obstacle, activation of the avoidance, and the link that "
        "its control point lies on, over time. Solid: seen, as the controller computes it from the "
        "filtered cloud. Dashed: true, exact meshes against the exact scene, known to the "
        "simulator only. Dotted: the two thresholds between which the activation rises.",
    ),
    (
        "pairs.png",
        "Closest pairs on the posture at which the first of the controllers was nearest. WB: any "
        "point of the arm's surface may be the control point. SM: only the sensors' mounting "
        "points. Blue: the obstacle. Red: the pair.",
    ),
    (
        "motion.gif",
        "Red: the filtered cloud. Blue: points that were taken for the arm itself and removed. "
        "Green: the pair that the avoidance acts on. The axes: the goal.",
    ),
)
PAPER_RESULTS = {
    "front_plane": "Fig. 7: WB keeps farther away, its control point on the flange; up to 100 mm "
    "more in all",
    "side_plane": "Fig. 8: a similar result; up to 100 mm more in all",
}
NAMES = {
    "wb": "wb, whole body",
    "sm": "sm, sensor points",
    "wb_known": "wb_known, scene known",
    "wb_memory": "wb_memory, with memory",
}


def runs_page(runs: Sequence[StoredRun], about: About) -> str:
    """The page of these runs: valid HTML, everything inside.

    Args:
        runs: scenario by scenario.
        about: how the whole was made, as `origin` has it.
    """
    title = "Whole-arm avoidance: " + ", ".join(run.summary.scenario for run in runs)
    return document(title, _parts(runs, about))


def _parts(runs: Sequence[StoredRun], about: About) -> Iterator[str]:
    yield from _introduction(runs)
    yield from _table(runs)
    yield from _verdict(runs)
    replays = Replays()
    played = [replays.of_runs(run.folder) for run in runs]
    pictures = Pictures(replays.used)
    for run, replay in zip(runs, played, strict=True):
        yield f"<h2>{escape(run.summary.scenario)}</h2>"
        if run.about.description:
            yield f"<p>{escape(capitalised(run.about.description).rstrip('. '))}.</p>"
        if _beside_a_person(run):
            yield from _phases(run)
        for name, caption in _pictures(run):
            yield pictures.part(run.folder / name, caption)
        yield replay
        yield from _coverage(run)
        yield from _trials(run)
        yield from recordings_part(run.folder, _STEPS)
    yield from origin_part(about)
    for run in runs:
        if run.settings:
            yield f"<h3>Settings of {escape(run.summary.scenario)}</h3>"
            yield '<p class="soft">The resolved scenario (scenario.toml); '
            yield "<code>proxcgal run</code> takes this file as it is.</p>"
            yield f"<pre>{escape(run.settings)}</pre>"
    yield from replays.parts()


def _pictures(run: StoredRun) -> Iterator[tuple[str, str]]:
    """File and caption; of the moving picture with how near each arm came."""
    for name, caption in PICTURES:
        if name == "motion.gif":
            least = {
                controller: run.summary.controllers[controller].true_min_m
                for controller in SIDE_BY_SIDE
                if controller in run.summary.controllers
            }
            near = [f"{c} {in_metres(value)} m" for c, value in least.items() if value is not None]
            start = "The arm in motion" + (f"; least true distance: {', '.join(near)}" * bool(near))
            yield name, f"{start}. {caption}"
        else:
            yield name, caption


def _introduction(runs: Sequence[StoredRun]) -> Iterator[str]:
    ran = {name for run in runs for name in run.summary.controllers}
    robots = ", ".join(sorted({str(run.summary.robot) for run in runs}))
    seeds = ", ".join(sorted({str(run.summary.seed) for run in runs}))
    beside = [run for run in runs if _beside_a_person(run)]
    if beside:
        recorded = ", ".join(dict.fromkeys(filter(None, (r.summary.recording for r in beside))))
        who = f"The person recorded in {recorded} moves" if recorded else "A virtual subject works"
        yield (
            f"<p>{escape(who)} beside the arm, which goes from way point to way point. True "
            "distances run from the person to the links that move.</p>"
        )
    sent = "is sent to a goal that lies beyond an obstacle"
    if len(beside) == len(runs):
        sent = "goes from way point to way point"
    yield (
        f"<p>A simulated arm ({escape(robots)}, seed {escape(seeds)}) with rings of 8 x 8 zone "
        f"time-of-flight sensors {sent}. Each scene is run "
        "by the controllers below. "
        + " ".join(f"{text}." for name, text in _MOVES.items() if name in ran)
        + "</p>"
    )


#: What each controller moves and is given.
_MOVES = {
    "wb": "<code>wb</code> moves the surface point nearest to the obstacle, on any link, covered "
    "with sensors or not",
    "sm": "<code>sm</code>, the baseline, moves only the sensors' own mounting points",
    "wb_known": "<code>wb_known</code> is <code>wb</code> with points of the scene itself in place "
    "of the sensors: the ceiling, not a result of ours",
    "wb_memory": "<code>wb_memory</code> is <code>wb</code> that remembers what left the sensors' "
    "view",
}


def _beside_a_person(run: StoredRun) -> bool:
    return any(numbers.mean_m for numbers in run.summary.controllers.values())


def _phases(run: StoredRun) -> Iterator[str]:
    """Mean distances beside a person."""
    phases = [*dict.fromkeys(p for n in run.summary.controllers.values() for p in n.mean_m)]
    columns = [(phase, which) for phase in phases for which in ("true", "seen")]
    return listing_part(
        Listing(
            caption="Mean distance to the person, over the cycle and in each phase: true, and "
            "seen (the filtered cloud's, moments without one left out).",
            names=("controller", *(p if which == "true" else which for p, which in columns)),
            units=("", *("true, m" if which == "true" else "m" for _, which in columns)),
            rows=[
                (
                    NAMES.get(name, name),
                    *(in_metres(numbers.mean_m.get(p, {}).get(which)) for p, which in columns),
                )
                for name, numbers in run.summary.controllers.items()
            ],
            left=1,
        )
    )


def _table(runs: Sequence[StoredRun]) -> Iterator[str]:
    heads = [head("scene", style="left"), head("controller", style="left")]
    heads += [
        head(name, unit)
        for name, unit in (
            ("true min", "m"), ("true final", "m"), ("seen min", "m"), ("goal error", "m"),
            ("violations", "ticks"), ("gain", "mm"),
        )
    ]  # fmt: skip
    return table_part(
        [*heads, head("the paper [WA]", style="left")],
        (row for run in runs for row in _rows(run)),
        "True distances are exact meshes against the exact scene; final is the mean of the last "
        "2 s; a violation is a tick under 0.05 m; gain is wb over sm. The paper gives curves and "
        "one number for all its experiments, no table.",
    )


def _rows(run: StoredRun) -> Iterator[Iterator[str]]:
    """A row a controller; scene, gain and paper stand beside all of them."""
    summary = run.summary
    count, gain = len(summary.controllers), summary.gain_mm

    def row(place: int, name: str, own: StoredNumbers) -> Iterator[str]:
        if place == 0:
            yield cell(summary.scenario, "left", rows=count)
        yield cell(NAMES.get(name, name), "left")
        for value in (own.true_min_m, own.true_final_m, own.seen_min_m, own.goal_error_m):
            yield cell(in_metres(value))
        yield cell("-" if own.violations is None else own.violations)
        if place == 0:
            yield cell("-" if gain is None else f"{gain:+.0f}", rows=count)
            yield cell(PAPER_RESULTS.get(summary.scenario, "-"), "text", rows=count)

    for place, (name, own) in enumerate(summary.controllers.items()):
        yield row(place, name, own)


def _verdict(runs: Sequence[StoredRun]) -> Iterator[str]:
    for run in runs:
        gain, ends = run.summary.gain_mm, run.summary.controllers
        if gain is not None and {"wb", "sm"} <= ends.keys() and not _beside_a_person(run):
            more = "farther from" if gain >= 0.0 else "nearer to"
            yield (
                f"<p>In <b>{escape(run.summary.scenario)}</b> the whole-body law ends "
                f"{abs(gain):.0f} mm {more} the obstacle than the sensor-point baseline, truly: "
                f"{in_metres(ends['wb'].true_final_m)} m against "
                f"{in_metres(ends['sm'].true_final_m)} m."
                "</p>"
            )
        own = run.summary.self_min_m
        if run.summary.failed:
            yield (
                f'<p class="bad">{escape(run.summary.scenario)}: failed: the arm came within '
                f"{in_metres(own)} m of itself, allowed is {SELF_LIMIT_M} m.</p>"
            )
    yield (
        '<p class="soft">Reaching the goal is not asked for: keeping the distance comes first. '
        "These are engineering figures from a simulation, not a certificate of any kind.</p>"
    )


def _coverage(run: StoredRun) -> Iterator[str]:
    """View of the truly closest points, where a run logged it."""
    found = {
        name: [shares.get(key) for key in COVERAGE_KEYS]
        for name, shares in run.summary.closest_points.items()
    }
    if all(share is None for shares in found.values() for share in shares):
        return iter(())
    return listing_part(
        Listing(
            caption="The truly closest points of the scene: in view of a sensor at the last scan; "
            "remembered, within the memory's time before (whether or not a controller with memory "
            "ran); forgotten, longer ago; never seen.",
            names=("controller", "in view", "remembered", "forgotten", "never seen"),
            units=("", "%", "%", "%", "%"),
            rows=[
                (NAMES.get(name, name), *("-" if s is None else f"{100.0 * s:.0f}" for s in shares))
                for name, shares in found.items()
            ],
            left=1,
        )
    )


def _trials(run: StoredRun) -> Iterator[str]:
    """Timings, modes and findings per trial."""
    if not run.about.trials:
        return iter(())
    heads = [
        head(name, unit)
        for name, unit in (
            ("tick median", "us"), ("tick p99", "us"), ("wall", "s"), ("own links", "m")
        )
    ]  # fmt: skip
    own = {name: numbers.self_min_m for name, numbers in run.summary.controllers.items()}
    rows = [
        [
            cell(name, "left"), cell(f"{trial.tick_median_us:.0f}"),
            cell(f"{trial.tick_p99_us:.0f}"), cell(f"{trial.wall_s:.1f}"),
            cell(in_metres(own.get(name))),
            cell(", ".join(f"{why}: {n}" for why, n in trial.findings.items()) or "none", "text"),
        ]
        for name, trial in run.about.trials.items()
    ]  # fmt: skip
    return table_part(
        [head("controller", style="left"), *heads, head("findings", style="left")], rows,
        "Time of one tick (perception and control, from Python), least distance between own links, "
        "and what the monitor found (reason: ticks).",
    )  # fmt: skip


_STEPS = " <code>proxcgal replay FILE</code> steps through one; Foxglove opens them."

"""The HTML of a report on trials: tables, figures, what was found."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape

from proxcgal.core.tables import in_metres
from proxcgal.evaluation.metrics import COVERAGE_KEYS, SELF_LIMIT_M
from proxcgal.report.document import (
    PICTURE_BYTES,
    REPLAY_BYTES,
    document,
    origin_part,
    picture,
)
from proxcgal.report.replays import Replays
from proxcgal.report.stored import About, Numbers, Run
from proxcgal.study.runs.pictures import MOVING

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
PAPER = {
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


def page(runs: Sequence[Run], about: About) -> str:
    """The page of these runs: valid HTML, everything inside.

    Args:
        runs: scenario by scenario.
        about: how the whole was made, as `origin` has it.
    """
    title = "Whole-arm avoidance: " + ", ".join(run.summary.scenario for run in runs)
    return document(title, _parts(runs, about))


def _parts(runs: Sequence[Run], about: About) -> Iterator[str]:
    yield from _introduction(runs)
    yield from _table(runs)
    yield from _verdict(runs)
    replays = Replays(REPLAY_BYTES)
    played = [replays.of_runs(run.folder) for run in runs]
    budget = PICTURE_BYTES - replays.used
    for run, replay in zip(runs, played, strict=True):
        yield f"<h2>{escape(run.summary.scenario)}</h2>"
        if run.about.description:
            yield f"<p>{escape(_sentence(run.about.description))}</p>"
        if _beside_a_person(run):
            yield from _phases(run)
        for name, caption in _pictures(run):
            part, used = picture(run.folder / name, caption, budget)
            budget -= used
            yield part
        yield replay
        yield from _coverage(run)
        yield from _trials(run)
        yield from _recordings(run)
    yield from origin_part(about)
    for run in runs:
        if run.settings:
            yield f"<h3>Settings of {escape(run.summary.scenario)}</h3>"
            yield f'<p class="soft">The resolved scenario ({escape("scenario.toml")}); '
            yield "<code>proxcgal run</code> takes this file as it is.</p>"
            yield f"<pre>{escape(run.settings)}</pre>"
    yield from replays.parts()


def _pictures(run: Run) -> Iterator[tuple[str, str]]:
    """File and caption; of the moving picture with how near each arm came."""
    for name, caption in PICTURES:
        if name == "motion.gif":
            least = {
                controller: run.summary.controllers[controller].true_min_m
                for controller in MOVING
                if controller in run.summary.controllers
            }
            told = [f"{c} {in_metres(value)} m" for c, value in least.items() if value is not None]
            start = "The arm in motion" + (f"; least true distance: {', '.join(told)}" * bool(told))
            yield name, f"{start}. {caption}"
        else:
            yield name, caption


def _introduction(runs: Sequence[Run]) -> Iterator[str]:
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
    yield (
        f"<p>A simulated arm ({escape(robots)}, seed {escape(seeds)}) with rings of 8 x 8 zone "
        f"time-of-flight sensors {_sent(runs)}. Each scene is run "
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


def _beside_a_person(run: Run) -> bool:
    return any(numbers.mean_m for numbers in run.summary.controllers.values())


def _sent(runs: Sequence[Run]) -> str:
    if all(_beside_a_person(run) for run in runs):
        return "goes from way point to way point"
    return "is sent to a goal that lies beyond an obstacle"


def _phases(run: Run) -> Iterator[str]:
    """Mean distances beside a person."""
    phases = [*dict.fromkeys(p for n in run.summary.controllers.values() for p in n.mean_m)]
    yield '<div class="scroll"><table><caption>Mean distance to the person, over the cycle and in '
    yield "each phase: true, and seen (the filtered cloud's, moments without one left out)."
    yield '</caption><thead><tr><th class="left">controller</th>'
    for phase in phases:
        yield f"<th>{escape(phase)}<small>true, m</small></th><th>seen<small>m</small></th>"
    yield "</tr></thead><tbody>"
    for name, numbers in run.summary.controllers.items():
        yield f'<tr><td class="left">{escape(NAMES.get(name, name))}</td>'
        for phase in phases:
            means = numbers.mean_m.get(phase, {})
            yield f"<td>{in_metres(means.get('true'))}</td><td>{in_metres(means.get('seen'))}</td>"
        yield "</tr>"
    yield "</tbody></table></div>"


def _table(runs: Sequence[Run]) -> Iterator[str]:
    yield '<div class="scroll"><table><caption>True distances are exact meshes against the exact '
    yield "scene; final is the mean of the last 2 s; a violation is a tick under 0.05 m; gain is "
    yield "wb over sm. The paper gives curves and one number for all its experiments, no table."
    yield "</caption>"
    yield '<thead><tr><th class="left">scene</th><th class="left">controller</th>'
    for name, unit in (
        ("true min", "m"),
        ("true final", "m"),
        ("seen min", "m"),
        ("goal error", "m"),
        ("violations", "ticks"),
        ("gain", "mm"),
    ):
        yield f"<th>{name}<small>{unit}</small></th>"
    yield '<th class="left">the paper [WA]</th></tr></thead><tbody>'
    for run in runs:
        controllers = run.summary.controllers
        for row, (name, numbers) in enumerate(controllers.items()):
            yield "<tr>"
            if row == 0:
                span = f' rowspan="{len(controllers)}"'
                yield f'<td class="left"{span}>{escape(run.summary.scenario)}</td>'
            yield f'<td class="left">{escape(NAMES.get(name, name))}</td>'
            for value in (
                numbers.true_min_m,
                numbers.true_final_m,
                numbers.seen_min_m,
                numbers.goal_error_m,
            ):
                yield f"<td>{in_metres(value)}</td>"
            yield f"<td>{'-' if numbers.violations is None else numbers.violations}</td>"
            if row == 0:
                gain = run.summary.gain_mm
                paper = escape(PAPER.get(run.summary.scenario, "-"))
                yield f"<td{span}>{'-' if gain is None else f'{gain:+.0f}'}</td>"
                yield f'<td class="text"{span}>{paper}</td>'
            yield "</tr>"
    yield "</tbody></table></div>"


def _verdict(runs: Sequence[Run]) -> Iterator[str]:
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


def _sentence(text: str) -> str:
    """Text as a sentence: a capital first, a full stop last."""
    return text[:1].upper() + text[1:].rstrip(". ") + "."


def _coverage(run: Run) -> Iterator[str]:
    """What the sensors had of the truly closest points, where a run asked."""
    told = {
        name: [shares.get(key) for key in COVERAGE_KEYS]
        for name, shares in run.summary.closest_points.items()
    }
    if not any(share is not None for shares in told.values() for share in shares):
        return
    yield '<div class="scroll"><table><caption>The truly closest points of the scene: in view of a '
    yield "sensor at the last scan; remembered, within the memory's time before (whether or not a "
    yield "controller with memory ran); forgotten, longer ago; never seen.</caption>"
    yield '<thead><tr><th class="left">controller</th>'
    for name in ("in view", "remembered", "forgotten", "never seen"):
        yield f"<th>{name}<small>%</small></th>"
    yield "</tr></thead><tbody>"
    for name, shares in told.items():
        yield f'<tr><td class="left">{escape(NAMES.get(name, name))}</td>'
        for share in shares:
            yield f"<td>{'-' if share is None else f'{100.0 * share:.0f}'}</td>"
        yield "</tr>"
    yield "</tbody></table></div>"


def _trials(run: Run) -> Iterator[str]:
    """Timings, modes and findings per trial."""
    if not run.about.trials:
        return
    yield '<div class="scroll"><table><caption>Time of one tick (perception and control, from '
    yield "Python), least distance between own links, and what the monitor found "
    yield "(reason: ticks).</caption>"
    yield '<thead><tr><th class="left">controller</th><th>tick median<small>us</small></th>'
    yield "<th>tick p99<small>us</small></th><th>wall<small>s</small></th>"
    yield '<th>own links<small>m</small></th><th class="left">findings</th></tr></thead><tbody>'
    for name, trial in run.about.trials.items():
        numbers = run.summary.controllers.get(name, Numbers())
        found = ", ".join(f"{reason}: {ticks}" for reason, ticks in trial.findings.items())
        yield (
            f'<tr><td class="left">{escape(name)}</td><td>{trial.tick_median_us:.0f}</td>'
            f"<td>{trial.tick_p99_us:.0f}</td><td>{trial.wall_s:.1f}</td>"
            f"<td>{in_metres(numbers.self_min_m)}</td>"
            f'<td class="text">{escape(found) or "none"}</td></tr>'
        )
    yield "</tbody></table></div>"


def _recordings(run: Run) -> Iterator[str]:
    files = sorted(run.folder.glob("*.mcap"))
    if files:
        names = ", ".join(f"<code>{escape(f.name)}</code>" for f in files)
        yield f'<p class="soft">Recordings of every tick beside this page: {names}. '
        yield "<code>proxcgal replay FILE</code> steps through one; Foxglove opens them.</p>"

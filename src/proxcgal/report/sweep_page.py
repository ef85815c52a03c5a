"""The HTML of a report on the timing grid."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape

from proxcgal.report.document import (
    PICTURE_BYTES,
    REPLAY_BYTES,
    document,
    origin_part,
    picture,
)
from proxcgal.report.replays import Replays
from proxcgal.report.stored import Exponent, StoredCell, Sweep
from proxcgal.study.timing.ratios import CYCLE_US, compare, cycle_verdict

_CURVES = (
    "Median time of one call from Python against the vertices of each link, both axes logarithmic. "
    "Solid: the literal algorithm. Dashed: the accelerated one, with the same answer. A colour a "
    "cloud. Dotted: the sensors' cycle, within which the paper's worst case stays."
)
PICTURES = (
    ("algorithm2.png", f"Algorithm 2, the closest pair, in the form of Fig. 10. {_CURVES}"),
    ("algorithm1.png", f"Algorithm 1, body removal; the paper prints no figure of it. {_CURVES}"),
)
CLOUDS = (
    "What the cells work on, in the form of Fig. 6, (a) in place of its photograph. Blue: all that "
    "the sensors see, the robot itself included. Green: what the filter leaves within 1 m. Dark: "
    "the vertices of the robot's meshes. Red: the closest pair."
)


def sweep_page(sweep: Sweep) -> str:
    """The page of a timing grid: valid HTML, everything inside."""
    return document("Timing of Algorithms 1 and 2", _parts(sweep))


def _parts(sweep: Sweep) -> Iterator[str]:
    cells = sweep.summary.cells
    robots = dict.fromkeys(cell.robot for cell in cells)
    yield (
        "<p>How long body removal (Algorithm 1) and the search for the closest pair (Algorithm 2) "
        f"take, on {escape(' and '.join(robots))}, one scan of 30 sensors in a room, as meshes get "
        "finer and clouds larger. <code>paper</code> is the literal algorithm on CGAL's own "
        "queries, <code>fast</code> the accelerated one; their answers are compared in every cell "
        "before it is timed. One thread, called from Python. Algorithm 1 gets the cloud as it was "
        "sensed, Algorithm 2 what the filter leaves of it.</p>"
    )
    yield f"<p>{escape(cycle_verdict(compare(cell.model_dump() for cell in cells)))}</p>"
    replays = Replays(REPLAY_BYTES)
    scenes = [replays.of_scene(f"timing_{robot}") for robot in robots]
    budget = PICTURE_BYTES - replays.used
    files = [*PICTURES, *((f"clouds_{robot}.png", CLOUDS) for robot in robots)]
    for name, caption in files:
        # A robot's name is a file's content here: it must not lead out of the folder.
        part, used = picture(sweep.folder / name.replace("/", "_"), caption, budget)
        budget -= used
        yield part
    yield from scenes
    yield "<h2>Times</h2>"
    yield from _times(cells)
    if sweep.summary.growth:
        yield "<h2>Growth</h2>"
        yield from _growth(sweep)
    yield (
        '<p class="soft">All cells and fits: <code>summary.json</code>; every single time: '
        f"<code>samples.csv</code>. Measured on {escape(sweep.summary.machine)}; times are this "
        "machine's, ratios carry further.</p>"
    )
    yield from origin_part(sweep.about)
    yield from replays.parts()


def _times(cells: Sequence[StoredCell]) -> Iterator[str]:
    """A row a pair of cells."""
    by_key = {_key(cell): cell for cell in cells}
    yield '<div class="scroll"><table><caption>Medians, 99th percentiles and longest of all calls, '
    yield f"in microseconds; bold: longer than the sensors' cycle of {CYCLE_US / 1000.0:g} ms. "
    yield "Ratio: medians, paper over fast.</caption>"
    yield '<thead><tr><th class="left">robot</th><th class="left">cloud</th>'
    for name in ("vertices", "points", "algorithm"):
        yield f"<th>{name}</th>"
    for method in ("paper", "fast"):
        for name in ("median", "p99", "max"):
            yield f"<th>{method}<small>{name}</small></th>"
    yield "<th>ratio</th></tr></thead><tbody>"
    for pair in compare(cell.model_dump() for cell in cells):
        yield f'<tr><td class="left">{escape(pair.robot)}</td>'
        yield f'<td class="left">{escape(pair.cloud)}</td><td>{pair.vertices}</td>'
        yield f"<td>{pair.points}</td><td>{pair.algorithm}</td>"
        for method in ("paper", "fast"):
            place = (pair.robot, pair.vertices, pair.cloud, pair.points, pair.algorithm, method)
            cell = by_key[place]
            for value in (cell.median_us, cell.p99_us, cell.max_us):
                text = f"{value:.0f}" if value >= 1000.0 else f"{value:.1f}"
                yield f"<td><b>{text}</b></td>" if value > CYCLE_US else f"<td>{text}</td>"
        yield f"<td>{pair.ratio:.1f}</td></tr>"
    yield "</tbody></table></div>"


def _key(cell: StoredCell) -> tuple[str, int, str, int, int, str]:
    return (cell.robot, cell.vertices, cell.cloud, cell.points, cell.algorithm, cell.method)


def _growth(sweep: Sweep) -> Iterator[str]:
    yield (
        "<p>time ~ x<sup>b</sup>: b fitted to the medians on logarithmic axes, with its 95 % "
        "interval. Beside it b of the same fit to the paper's cost, every constant 1: Algorithm 1 "
        "by (2), N M log V + N M for each link, Algorithm 2 by (3), log V more: linear in the "
        "points, logarithmic in the vertices.</p>"
    )
    yield '<div class="scroll"><table><thead><tr><th class="left">robot</th><th>algorithm</th>'
    yield '<th class="left">method</th><th>with vertices</th><th>formula</th>'
    yield "<th>with points</th><th>formula</th></tr></thead><tbody>"
    for row in sweep.summary.growth:
        yield f'<tr><td class="left">{escape(row.robot)}</td><td>{row.algorithm}</td>'
        yield f'<td class="left">{escape(row.method)}</td>'
        for fit in (row.vertices, row.points):
            yield "<td>-</td><td>-</td>" if fit is None else _exponent(fit)
        yield "</tr>"
    yield "</tbody></table></div>"


def _exponent(fit: Exponent) -> str:
    ends = "" if fit.low is None or fit.high is None else f" ({fit.low:.2f} to {fit.high:.2f})"
    return f"<td>{fit.exponent:.2f}{ends}</td><td>{fit.formula:.2f}</td>"

"""The HTML of a report on the timing grid."""

from collections.abc import Iterable, Iterator, Sequence
from html import escape

from proxcgal.report.document import Pictures, cell, document, head, origin_part, table_part
from proxcgal.report.replays import Replays
from proxcgal.report.stored_results import Exponent, StoredCell, StoredSweep
from proxcgal.study.timing.comparison import CYCLE_US, Comparison, compare, cycle_verdict
from proxcgal.study.timing.grid import METHODS

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


def sweep_page(sweep: StoredSweep) -> str:
    """The page of a timing grid: valid HTML, everything inside."""
    return document("Timing of Algorithms 1 and 2", _parts(sweep))


def _parts(sweep: StoredSweep) -> Iterator[str]:
    cells = sweep.summary.cells
    robots = dict.fromkeys(each.robot for each in cells)
    yield (
        "<p>How long body removal (Algorithm 1) and the search for the closest pair (Algorithm 2) "
        f"take, on {escape(' and '.join(robots))}, one scan of 30 sensors in a room, as meshes get "
        "finer and clouds larger. <code>paper</code> is the literal algorithm on CGAL's own "
        "queries, <code>fast</code> the accelerated one; their answers are compared in every cell "
        "before it is timed. One thread, called from Python. Algorithm 1 gets the cloud as it was "
        "sensed, Algorithm 2 what the filter leaves of it.</p>"
    )
    yield f"<p>{escape(cycle_verdict(compare(each.model_dump() for each in cells)))}</p>"
    replays = Replays()
    scenes = [replays.of_scene(f"timing_{robot}") for robot in robots]
    pictures = Pictures(replays.used)
    files = [*PICTURES, *((f"clouds_{robot}.png", CLOUDS) for robot in robots)]
    for name, caption in files:
        # A robot's name is a file's content here: it must not lead out of the folder.
        yield pictures.part(sweep.folder / name.replace("/", "_"), caption)
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
    heads = [head("robot", style="left"), head("cloud", style="left")]
    heads += map(head, ("vertices", "points", "algorithm"))
    heads += [head(method, name) for method in METHODS for name in ("median", "p99", "max")]

    def row(pair: Comparison) -> Iterator[str]:
        yield from (cell(pair.paper[key], "left") for key in ("robot", "cloud"))
        yield from (cell(pair.paper[key]) for key in ("vertices", "points", "algorithm"))
        for own in (pair.paper, pair.fast):
            for value in (own["median_us"], own["p99_us"], own["max_us"]):
                text = f"{value:.0f}" if value >= 1000.0 else f"{value:.1f}"
                yield cell(text, bold=value > CYCLE_US)
        yield cell(f"{pair.ratio:.1f}")

    return table_part(
        [*heads, head("ratio")],
        map(row, compare(each.model_dump() for each in cells)),
        "Medians, 99th percentiles and longest of all calls, in microseconds; bold: longer than "
        f"the sensors' cycle of {CYCLE_US / 1000.0:g} ms. Ratio: medians, paper over fast.",
    )


def _growth(sweep: StoredSweep) -> Iterator[str]:
    yield (
        "<p>time ~ x<sup>b</sup>: b fitted to the medians on logarithmic axes, with its 95 % "
        "interval. Beside it b of the same fit to the paper's cost, every constant 1: Algorithm 1 "
        "by (2), N M log V + N M for each link, Algorithm 2 by (3), log V more: linear in the "
        "points, logarithmic in the vertices.</p>"
    )
    heads = [head("robot", style="left"), head("algorithm"), head("method", style="left")]
    heads += map(head, ("with vertices", "formula", "with points", "formula"))
    yield from table_part(
        heads,
        (
            [cell(row.robot, "left"), cell(row.algorithm), cell(row.method, "left"),
             *_exponent(row.vertices), *_exponent(row.points)]
            for row in sweep.summary.growth
        ),
    )  # fmt: skip


def _exponent(fit: Exponent | None) -> Iterable[str]:
    if fit is None:
        return map(cell, ("-", "-"))
    ends = "" if fit.low is None or fit.high is None else f" ({fit.low:.2f} to {fit.high:.2f})"
    return map(cell, (f"{fit.exponent:.2f}{ends}", f"{fit.formula:.2f}"))

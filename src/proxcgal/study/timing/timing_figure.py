"""The timing grid as curves, in the form of the paper's Fig. 10."""

from collections.abc import Sequence
from itertools import chain, zip_longest
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter

from proxcgal.study.plotting import DASHED, DOTTED, GREY, legend_below, new_figure, tidy_axes
from proxcgal.study.timing.comparison import CYCLE_US
from proxcgal.study.timing.grid import ALGORITHMS, TimingCell
from proxcgal.study.timing.inputs import REACH

CLOUD_COLOURS = {"raw": "#0072B2", "2m": "#D55E00", "1m": "#009E73"}
CLOUD_NAMES = {"raw": "raw", "2m": "within 2 m", "1m": "within 1 m"}
STYLES: dict[str, dict[str, Any]] = {
    "paper": {"linestyle": "-", "marker": "o"},
    "fast": {"linestyle": DASHED, "marker": "s", "markerfacecolor": "white"},
}
_CYCLE: dict[str, Any] = {"color": GREY, "linewidth": 1.0, "linestyle": DOTTED}
METHOD_NAMES = {"paper": "literal (paper)", "fast": "accelerated (fast)"}


def timing_figure(cells: Sequence[TimingCell], algorithm: int) -> Figure:
    """Median time against vertices, one curve a cloud and method, one panel a robot.

    The form of [WA] Fig. 10, which is of Algorithm 2; both axes logarithmic, since the two methods
    lie decades apart.

    Args:
        cells: of the grid; those of the other algorithm are passed over.
        algorithm: 1 or 2.
    """
    own = [cell for cell in cells if cell.algorithm == algorithm]
    robots = sorted({cell.robot for cell in own})
    title = f"Algorithm {algorithm}: {ALGORITHMS[algorithm]}"
    figure = new_figure(0.6 + 3.7 * len(robots), 4.4, title)
    panels = figure.subplots(1, len(robots), sharey=True, squeeze=False)[0]
    for letter, robot, ax in zip("abcdefgh", robots, panels, strict=False):
        _draw_times(ax, [cell for cell in own if cell.robot == robot])
        ax.set_title(f"({letter}) {robot}", fontsize=10)
    panels[0].set_ylabel("median time of a call [ms]", fontsize=10)
    legend_below(figure, _legend(own), rows=2)
    return figure


def _draw_times(ax: Axes, cells: Sequence[TimingCell]) -> None:
    for cloud in REACH:
        for method, style in STYLES.items():
            curve = [c for c in cells if (c.cloud, c.method) == (cloud, method)]
            curve.sort(key=lambda cell: cell.vertices)
            ax.plot(
                [cell.vertices for cell in curve], [cell.median_us / 1000.0 for cell in curve],
                color=CLOUD_COLOURS[cloud], markersize=4.5, linewidth=1.5, **style,
            )  # fmt: skip
    ax.axhline(CYCLE_US / 1000.0, zorder=1, **_CYCLE)
    ax.set(xscale="log", yscale="log", xlabel="vertices of each link")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.grid(which="major", color="#E4E4E4", linewidth=0.6)
    tidy_axes(ax)


def _legend(cells: Sequence[TimingCell]) -> list[Line2D]:
    """A row of clouds with their sizes above methods and the cycle, column by column."""
    clouds = []
    for cloud, colour in CLOUD_COLOURS.items():
        own = sorted((c for c in cells if c.cloud == cloud), key=lambda c: c.robot)
        sizes = list(dict.fromkeys(cell.points for cell in own))  # as the panels stand
        if sizes:
            label = f"{CLOUD_NAMES[cloud]}: {' and '.join(map(str, sizes))} points"
            clouds.append(Line2D([], [], color=colour, linewidth=3.0, label=label))
    methods = [
        Line2D([], [], color=GREY, markersize=4.5, linewidth=1.5, label=METHOD_NAMES[name], **style)
        for name, style in STYLES.items()
    ]
    label = f"sensors' cycle, {CYCLE_US / 1000.0:g} ms"
    methods.append(Line2D([], [], label=label, **_CYCLE))
    nothing = Line2D([], [], linestyle="none", label=" ")
    return list(chain.from_iterable(zip_longest(clouds, methods, fillvalue=nothing)))

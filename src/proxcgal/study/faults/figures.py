"""How soon every fault was answered."""

import numpy as np
import polars as pl
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from proxcgal.core.modes import DEGRADED, HOLD, NAMES, RUN, STOP
from proxcgal.evaluation.metrics import Summary
from proxcgal.study.faults.cases import ROWS
from proxcgal.study.plotting import GREY, legend_below, new_figure

COLOURS = {DEGRADED: "#E69F00", HOLD: "#0072B2", STOP: "#333333"}


def figures(table: pl.DataFrame, _: Summary | None = None) -> dict[str, Figure]:
    """Latency of every run, row by row, beside its bound; none where every trial failed."""
    done = table.filter(pl.col("error").is_null())
    robots = done["robot"].unique(maintain_order=True).to_list()
    if not robots:
        return {}
    rows = [row for row in ROWS if row.least > RUN]
    figure = new_figure(4.2 * len(robots) + 1.6, 4.6)
    for ax, robot in zip(
        np.atleast_1d(figure.subplots(1, len(robots), sharey=True)), robots, strict=True
    ):
        for height, row in enumerate(reversed(rows)):
            own = done.filter(pl.col("robot") == robot, pl.col("row") == row.name)
            latency = own["latency_ms"].drop_nulls().to_numpy()
            spread = np.linspace(-0.25, 0.25, len(latency))
            ax.plot(
                latency,
                height + spread,
                ".",
                color=COLOURS[row.least],
                markersize=4,
                alpha=0.6,
                zorder=3,
            )
            ax.plot(
                [1000 * row.within] * 2, [height - 0.4, height + 0.4], color=GREY, lw=1.2, zorder=1
            )
        ax.set_yticks(range(len(rows)), [row.name for row in reversed(rows)], fontsize=9)
        ax.spines[["top", "right"]].set_visible(False)
        # From below 0, so that a bound of 0 is seen.
        ax.set(title=robot, xlabel="time to the required mode [ms]", xlim=(-5.0, None))
    handles = [Line2D([], [], color=colour, marker=".", linestyle="", label=NAMES[mode])
               for mode, colour in COLOURS.items()]  # fmt: skip
    handles.append(Line2D([], [], color=GREY, linewidth=2, label="bound"))
    legend_below(figure, handles)
    return {"latency.png": figure}

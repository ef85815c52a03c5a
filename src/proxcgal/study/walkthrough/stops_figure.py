"""Distribution of stops over random operators."""

import polars as pl
from matplotlib.figure import Figure

from proxcgal.evaluation.metrics import Summary
from proxcgal.study.plotting import DASHED, GREY, new_figure, tidy_axes

COLOURS = {"overspeed": "#D55E00", "too_close": "#0072B2", "closing_fast": "#009E73"}
#: Trials in which something tripped; without any that ended the column has no type.
STOPPED = pl.col("tripped").cast(pl.String) != "none"


def figures(table: pl.DataFrame, _: Summary | None = None) -> dict[str, Figure]:
    """Distribution of stop times and distances; none where nothing stopped."""
    done = table.filter(pl.col("error").is_null(), STOPPED)
    if done.is_empty():
        return {}
    figure = new_figure(8.0, 3.7)
    for ax, (column, label, limit) in zip(
        figure.subplots(1, 2, sharey=True),
        (
            ("stop_time_s", "stopping time [s]", "stop_time_bound_s"),
            ("stop_distance_m", "way of the tool [m]", "min_distance_m"),
        ),
        strict=True,
    ):  # fmt: skip
        for name, colour in COLOURS.items():
            values = done.filter(pl.col("wish") == name)[column].drop_nulls().to_numpy()
            if len(values):
                ax.ecdf(values, color=colour, lw=1.6, label=name)
        bound = float(done[limit][0])  # one for all, by --set too
        ax.axvline(bound, color=GREY, lw=1.0, ls=DASHED)
        ax.annotate(
            "declared" if column == "stop_time_s" else "min_distance",
            (bound, 0.04),
            xytext=(-4, 0),
            textcoords="offset points",
            ha="right",
            fontsize=9,
            color=GREY,
        )
        most = done[column].drop_nulls().max()  # what is over the bound must be seen
        ax.set_xlim(0.0, max(1.15 * bound, 1.05 * float(most or 0.0)))  # type: ignore[arg-type]
        ax.set_xlabel(label, fontsize=10)
        tidy_axes(ax)
    figure.axes[0].set(ylabel="share of stops [-]", ylim=(0.0, 1.04))
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return {"stops.png": figure}

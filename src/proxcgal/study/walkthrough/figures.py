"""Walk-throughs over time, as [WT] Figs. 6 to 8, ratings as Fig. 9, and how stops are spread."""

from collections.abc import Mapping, Sequence

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from proxcgal.core.typing import Array
from proxcgal.evaluation.metrics import Summary
from proxcgal.study.plotting import (
    DASHED,
    DOTTED,
    GREY,
    LEGEND,
    legend_below,
    new_figure,
    tidy_axes,
)
from proxcgal.trial.walkthrough.log import WalkLog
from proxcgal.trial.walkthrough.run import WalkResult

BLUE, ORANGE, RED, GREEN = "#0072B2", "#E69F00", "#D55E00", "#009E73"
SCALE = 1.08  # of the tallest curve: how high the STO signal is drawn
_BEFORE, _AFTER = 0.10, 0.45  # [s] of the magnified window, round the trip
COLOURS = {"overspeed": "#D55E00", "too_close": "#0072B2", "closing_fast": "#009E73"}
#: Trials in which something tripped; without any that ended the column has no type.
STOPPED = pl.col("tripped").cast(pl.String) != "none"


def trip_figure(log: WalkLog, *, title: str, window: Sequence[float] | None = None) -> Figure:
    """The quantity that tripped, its limit and the scaled STO signal; beside it, magnified.

    The form of [WT] Fig. 6; where another quantity than the tool's speed trips, that speed stands
    below it, as in Figs. 7 and 8.

    Args:
        log: one with a trip.
        title: above the figure.
        window: [s] of the magnification; left out: round the stop.
    """
    trip = log.trips[0]
    watched = {
        "distance": (log.distance, log.distance_limit, "distance [m]"),
        "relative_velocity": (log.velocity, log.velocity_limit, "relative velocity [m/s]"),
        "joint_speed": (log.speed_ratio, 1.0, "joint speed, of its bound [-]"),
        "joint_acceleration": (log.acceleration_ratio, 1.0, "joint accel., of its bound [-]"),
    }
    rows = [(log.tcp_speed, log.tcp_limit, "tool speed [m/s]", trip.function == "tcp_speed")]
    if trip.function in watched:
        rows.insert(0, (*watched[trip.function], True))
    inside = (trip.time_s - _BEFORE, trip.time_s + _AFTER) if window is None else window
    figure = new_figure(8.4, 1.0 + 2.3 * len(rows), title)
    axes = figure.subplots(len(rows), 2, squeeze=False, width_ratios=(1.5, 1.0), sharey="row")
    for (whole, near), (values, limit, label, own) in zip(axes, rows, strict=True):
        for ax in (whole, near):
            _curve(ax, log, values, limit if own else None)
        whole.set(ylabel=label, xlim=(0.0, log.time[-1]))
        whole.axvspan(*inside, color=GREY, alpha=0.10, lw=0)
        near.set_xlim(*inside)
        near.axvline(trip.time_s, color=RED, lw=0.9, ls=DASHED)
        stop = log.stop_time_s()
        if stop is not None and np.isfinite(stop):
            near.axvline(trip.time_s + stop, color=GREEN, lw=0.9, ls=DASHED)
    _stop_arrow(axes[-1][1], log)
    for ax in axes[-1]:
        ax.set_xlabel("time [s]", fontsize=10)
    legend_below(figure, axes[0][0].get_legend_handles_labels()[0])
    return figure


def _curve(ax: Axes, log: WalkLog, values: Array, limit: float | None) -> None:
    finite = values[np.isfinite(values)]
    top = SCALE * max(float(finite.max(initial=0.0)), limit or 0.0)
    ax.plot(log.time, values, color=BLUE, lw=1.4, label="measured")
    if limit is not None:
        ax.axhline(limit, color=GREY, lw=1.0, ls=DOTTED, label="limit")
    ax.step(log.time, np.where(log.torque, top, 0.0), color=ORANGE, lw=1.3, where="post",
            label="STO, scaled")  # fmt: skip
    ax.set_ylim(1.05 * float(finite.min(initial=0.0)), 1.06 * top)
    tidy_axes(ax)


def _stop_arrow(ax: Axes, log: WalkLog) -> None:
    stop = log.stop_time_s()
    if stop is None or not np.isfinite(stop):
        return
    at, height = log.trips[0].time_s, 0.62 * ax.get_ylim()[1]
    ax.annotate("", (at, height), (at + stop, height), arrowprops={"arrowstyle": "<->", "lw": 0.9})
    ax.text(at + stop + 0.015, height, f"at rest after\n{stop:.3f} s", fontsize=9, va="center")


def teach_figure(result: WalkResult, *, title: str, hand_guiding: float) -> Figure:
    """Speed while teaching, fast and by the hand-guiding rules; the path taught and played back.

    Args:
        result: one that was taught to the end.
        title: above the figure.
        hand_guiding: [m/s] of those rules.
    """
    log, path, played = result.log, result.path, result.played
    assert path is not None
    assert played is not None
    figure = new_figure(8.4, 6.6, title)
    grid = figure.add_gridspec(3, 2, height_ratios=(1.5, 1.5, 1.0))
    speed, distance = figure.add_subplot(grid[0, :]), figure.add_subplot(grid[1, 0])
    plane, error = figure.add_subplot(grid[1, 1]), figure.add_subplot(grid[2, :])
    top = SCALE * log.tcp_limit
    speed.step(log.time, np.where(log.torque, top, 0.0), color=ORANGE, lw=1.3, where="post",
               label="STO, scaled")  # fmt: skip
    if result.slow is not None:
        slow = result.slow
        speed.plot(
            slow.time, slow.tcp_speed, color=GREEN, lw=1.2, label="by the hand-guiding rules"
        )
        speed.axhline(hand_guiding, color=GREEN, lw=0.9, ls=DOTTED)
    speed.plot(log.time, log.tcp_speed, color=BLUE, lw=1.4, label="at the process's speed")
    speed.axhline(log.tcp_limit, color=GREY, lw=1.0, ls=DOTTED, label="limits")
    speed.set(
        ylabel="tool speed [m/s]", xlabel="time [s]", xlim=(0.0, None), ylim=(0.0, 1.06 * top)
    )
    speed.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, **LEGEND)
    distance.plot(log.time, log.distance, color=BLUE, lw=1.4, label="distance")
    distance.plot(log.time, log.protective_m, color=RED, lw=1.1, label="ISO/TS 15066 would ask for")
    distance.axhline(log.distance_limit, color=GREY, lw=1.0, ls=DOTTED, label="limit")
    distance.set(
        ylim=(0.0, 1.5 * float(log.protective_m.max())),
        ylabel="robot to operator [m]",
        xlabel="time [s]",
    )
    distance.legend(loc="upper left", ncols=1, **LEGEND)
    taught, ran = path.raw_tool_W, played.log.tool_W[-len(played.error_m) :]
    plane.plot(taught[:, 1], taught[:, 2], color=BLUE, lw=2.4, alpha=0.5, label="taught")
    plane.plot(ran[:, 1], ran[:, 2], color="black", lw=0.8, label="played back")
    plane.set_aspect("equal", adjustable="datalim")
    plane.set(xlabel="y [m]", ylabel="z [m]")
    plane.legend(loc="upper right", **LEGEND)
    times = np.arange(len(played.error_m)) * log.period
    error.plot(times, 1000.0 * played.error_m, color=BLUE, lw=1.2)
    error.set(
        ylabel="played\nfrom taught [mm]",
        xlabel="time of the playback [s]",
        xlim=(0.0, times[-1]),
        ylim=(0.0, None),
    )
    tidy_axes(speed, distance, plane, error)
    return figure


def ratings_figure(ratings: Mapping[str, Sequence[float]]) -> Figure:
    """Box plot and histogram of each indicator, in the form of [WT] Fig. 9.

    Args:
        ratings: 0 to 10 of each tester, by indicator.
    """
    count = max(len(ratings), 1)
    figure = new_figure(6.4, 0.4 + 2.5 * count)
    grid = figure.subplots(count, 2, squeeze=False, width_ratios=(1.0, 2.2))
    for (box, bars), (name, values) in zip(grid, ratings.items(), strict=True):
        box.boxplot(
            [list(values)], showmeans=True, widths=0.5, tick_labels=[""],
            medianprops={"color": ORANGE, "lw": 1.8},
            meanprops={"marker": "^", "markerfacecolor": GREEN, "markeredgecolor": GREEN},
        )  # fmt: skip
        box.set(ylim=(-0.5, 10.5), ylabel=f"{name}\nrating, 0 to 10")
        share = np.histogram(values, np.arange(-0.5, 11.0))[0] / max(len(values), 1)
        bars.bar(np.arange(11), share, color=BLUE, width=0.8)
        bars.set(xlabel="rating", ylabel="share of testers", xticks=range(11))
        tidy_axes(box, bars)
    return figure


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
        farthest = max(1.15 * bound, 1.05 * float(most or 0.0))  # type: ignore[arg-type]
        ax.set(xlim=(0.0, farthest), xlabel=label)
        tidy_axes(ax)
    figure.axes[0].set(ylabel="share of stops [-]", ylim=(0.0, 1.04))
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return {"stops.png": figure}

"""Trials in the form of the paper's figures: over time (Figs. 7, 8) and as pairs (Fig. 3)."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from proxcgal.sim.trial import TrialLog

DPI = 160
# Okabe and Ito's palette: told apart with any colour vision, and in print by lightness.
COLOURS = {"wb": "#0072B2", "sm": "#D55E00", "wb_known": "#009E73"}
NAMES = {"wb": "whole body (WB)", "sm": "sensor points (SM)", "wb_known": "WB, scene known"}
BANDS = ("#56B4E9", "#F0E442", "#CC79A7", "#E69F00", "#9BD8C2", "#B9B9E8", "#D9C6A5", "#C7C7C7")
GREY = "#5A5A5A"
STYLE: dict[str, Any] = {"fontsize": 10}
LEGEND: dict[str, Any] = {"frameon": False, "fontsize": 9, "handlelength": 2.4}


def time_figure(logs: Sequence[TrialLog], *, title: str, d_min: float, buffer: float) -> Figure:
    """Distance, activation and link of the control point over time, all controllers in one.

    The form of [WA] Figs. 7 and 8, with the true distance (dashed) beside the seen one (solid).

    Args:
        logs: trials of one scenario, one per controller.
        title: above the figure.
        d_min: distance that the avoidance keeps [m].
        buffer: Delta, over which its activation rises [m].
    """
    figure = Figure(figsize=(7.2, 5.8), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, fontsize=12, fontweight="bold")
    axes = figure.subplots(3, 1, sharex=True, height_ratios=(3.4, 1.5, 0.32 * len(logs) + 0.1))
    _distances(axes[0], logs, d_min, buffer)
    _activations(axes[1], logs)
    _links(axes[2], logs)
    axes[2].set_xlabel("time [s]", **STYLE)
    axes[2].set_xlim(0.0, max(float(log.time[-1]) for log in logs))
    for ax in axes:
        ax.tick_params(labelsize=9)
        ax.spines[["top", "right"]].set_visible(False)
    return figure


def _distances(ax: Axes, logs: Sequence[TrialLog], d_min: float, buffer: float) -> None:
    for level, label in ((d_min, r"$d_{min}$"), (d_min + buffer, r"$d_{min}+\Delta$")):
        ax.axhline(level, color=GREY, linewidth=1.0, linestyle=(0, (1, 1.5)), zorder=1)
        ax.annotate(
            label,
            (1.0, level),
            xycoords=("axes fraction", "data"),
            xytext=(5, 0),
            textcoords="offset points",
            va="center",
            fontsize=9,
            color=GREY,
        )
    highest = d_min + buffer
    for log in logs:
        colour = COLOURS.get(log.controller, "black")
        seen = np.where(np.isfinite(log.seen_m), log.seen_m, np.nan)
        known = log.controller == "wb_known"
        if not known:  # with the scene known the two hardly differ: one line says it
            ax.plot(log.time, seen, color=colour, linewidth=1.6, zorder=3)
        width = 1.0 if known else 1.6
        ax.plot(log.time, log.true_m, color=colour, linewidth=width, linestyle=(0, (4, 1.6)))
        finite = log.true_m[np.isfinite(log.true_m)]
        highest = max(highest, float(finite.max(initial=0.0)), float(np.nanmax(seen, initial=0.0)))
    ax.set_ylim(0.0, 1.06 * highest)
    ax.set_ylabel("minimum distance [m]", **STYLE)
    handles = [
        Line2D([], [], color=COLOURS.get(log.controller, "black"), linewidth=2.2) for log in logs
    ]
    labels = [NAMES.get(log.controller, log.controller) for log in logs]
    handles += [
        Line2D([], [], color=GREY, linewidth=1.6),
        Line2D([], [], color=GREY, linewidth=1.6, linestyle=(0, (4, 1.6))),
    ]
    labels += ["seen", "true"]
    ax.legend(
        handles,
        labels,
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=len(labels),
        columnspacing=1.4,
        **LEGEND,
    )


def _activations(ax: Axes, logs: Sequence[TrialLog]) -> None:
    for log in logs:
        width = 1.0 if log.controller == "wb_known" else 1.6
        colour = COLOURS.get(log.controller, "black")
        ax.plot(log.time, log.activation, color=colour, linewidth=width)
    ax.set_ylim(-0.05, 1.08)
    ax.set_yticks((0.0, 0.5, 1.0))
    ax.set_ylabel("activation [-]", **STYLE)


def _links(ax: Axes, logs: Sequence[TrialLog]) -> None:
    """One band a controller, coloured and labelled by the link that the avoidance moves."""
    order: list[str] = []
    for log in logs:
        order += [link for link in dict.fromkeys(log.control_link) if link and link not in order]
    duration = max(float(log.time[-1]) for log in logs)
    for row, log in enumerate(reversed(logs)):
        for link, start, end in _spans(log):
            colour = BANDS[order.index(link) % len(BANDS)]
            ax.broken_barh([(start, end - start)], (row - 0.38, 0.76), facecolors=colour)
            if end - start > 0.011 * duration * len(link):  # else the text would not fit
                ax.text((start + end) / 2, row, link, ha="center", va="center", fontsize=7.5)
    ax.set_yticks(range(len(logs)), [log.controller for log in reversed(logs)])
    ax.set_ylim(-0.6, len(logs) - 0.4)
    ax.set_ylabel("control\npoint on", **STYLE)


def _spans(log: TrialLog) -> Iterator[tuple[str, float, float]]:
    """(link, start, end) of every stretch of time with the same link, those with none left out."""
    links = np.asarray(log.control_link)
    starts = np.flatnonzero(np.r_[True, links[1:] != links[:-1]])
    ends = np.r_[log.time[starts[1:]], log.time[-1]]
    for start, end in zip(starts, ends, strict=True):
        if links[start]:
            yield str(links[start]), float(log.time[start]), float(end)


@dataclass(frozen=True, slots=True, kw_only=True)
class PairView:
    """One controller's closest pair on one posture, as Fig. 3 shows it."""

    title: str
    robot_W: NDArray[np.float64]  # (n, 3) [m] mesh vertices, or sensor mounting points
    context_W: NDArray[np.float64]  # (m, 3) [m] the rest of the arm, drawn faintly; may be empty
    obstacle_W: NDArray[np.float64]  # (k, 3) [m]
    control_W: NDArray[np.float64]  # (3,) [m] point of the robot
    nearest_W: NDArray[np.float64]  # (3,) [m] point of the obstacle
    link: str

    @property
    def distance(self) -> float:
        """Length of the pair [m]."""
        return float(np.linalg.norm(self.control_W - self.nearest_W))


def pair_figure(rows: Sequence[Sequence[PairView]], *, title: str) -> Figure:
    """Closest pairs side by side, a row a scene: the form of [WA] Fig. 3.

    The robot (or its sensors) as points, the obstacle in blue, a red arrow from the obstacle's
    point to the control point.
    """
    columns = len(rows[0])
    figure = Figure(figsize=(3.7 * columns, 3.75 * len(rows) + 0.3), dpi=DPI)
    FigureCanvasAgg(figure)
    figure.suptitle(title, fontsize=12, fontweight="bold", y=1.0 - 0.1 / len(rows) / 3.75)
    top = 1.0 - 0.42 / (3.75 * len(rows) + 0.3)
    figure.subplots_adjust(left=0.0, right=0.97, bottom=0.04, top=top, wspace=0.02, hspace=0.1)
    for i, row in enumerate(rows):
        everything = np.vstack([np.vstack((v.robot_W, v.context_W, v.obstacle_W)) for v in row])
        for j, view in enumerate(row):
            ax = figure.add_subplot(len(rows), columns, i * columns + j + 1, projection="3d")
            _draw_pair(ax, view, everything)
            letter = "abcdefgh"[i * columns + j]
            ax.set_title(f"({letter}) {view.title}", fontsize=10, y=1.0)
    return figure


def _draw_pair(ax: Any, view: PairView, everything: NDArray[np.float64]) -> None:
    low, high = everything.min(axis=0), everything.max(axis=0)
    ax.set_proj_type("ortho")
    ax.view_init(elev=20.0, azim=-62.0)
    ax.set_box_aspect(high - low, zoom=1.05)
    for setter, a, b in zip((ax.set_xlim, ax.set_ylim, ax.set_zlim), low, high, strict=True):
        setter(a, b)
    ax.computed_zorder = False  # the arrow belongs on top, whatever lies before it
    ax.scatter(*view.obstacle_W.T, s=2.5, color="#2C6FDB", depthshade=False, linewidths=0, zorder=1)
    if len(view.context_W):
        ax.scatter(*view.context_W.T, s=0.8, color="#D8D8D8", linewidths=0, zorder=2)
    many = len(view.robot_W) > 200
    ax.scatter(
        *view.robot_W.T,
        s=1.6 if many else 14,
        color="#606060" if many else "black",
        linewidths=0,
        zorder=3,
        alpha=0.6 if many else 1.0,
    )
    ends = np.vstack((view.nearest_W, view.control_W))
    ax.plot(*ends.T, color="#D00000", linewidth=2.2, zorder=5)
    ax.scatter(*view.control_W, s=34, color="#D00000", marker="o", linewidths=0, zorder=6)
    ax.scatter(*view.nearest_W, s=20, color="#D00000", marker="s", linewidths=0, zorder=6)
    ax.set_xlabel("x [m]", fontsize=8, labelpad=-4)
    ax.set_ylabel("y [m]", fontsize=8, labelpad=-4)
    ax.set_zlabel("z [m]", fontsize=8, labelpad=-4)
    ax.tick_params(labelsize=7, pad=-2)
    ax.locator_params(nbins=4)
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        axis._axinfo["grid"].update(color="#E4E4E4", linewidth=0.5)
    ax.text2D(
        0.03,
        0.03,
        f"{1000 * view.distance:.0f} mm, {view.link}",
        transform=ax.transAxes,
        fontsize=9,
        color="#B00000",
    )


def png(figure: Figure) -> bytes:
    """The figure as a PNG file's bytes, the same for the same figure."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})
    return buffer.getvalue()

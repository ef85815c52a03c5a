"""Trials over time, in the form of the paper's Figs. 7 and 8."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from proxcgal.core import modes
from proxcgal.core.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from proxcgal.evaluation.trial_log import TrialLog

DPI = 160
# Okabe and Ito's palette: told apart with any colour vision, and in print by lightness.
COLOURS = {"wb": "#0072B2", "sm": "#D55E00", "wb_known": "#009E73", "wb_memory": "#E69F00"}
NAMES = {
    "wb": "whole body (WB)",
    "sm": "sensor points (SM)",
    "wb_known": "WB, scene known",
    "wb_memory": "WB, memory",
}
BANDS = ("#56B4E9", "#F0E442", "#CC79A7", "#E69F00", "#9BD8C2", "#B9B9E8", "#D9C6A5", "#C7C7C7")
GREY = "#5A5A5A"
#: The monitor's modes but RUN, in colours that no controller has.
MODE_COLOURS = {modes.DEGRADED: "#F0E442", modes.HOLD: "#CC79A7", modes.STOP: "#333333"}
DASHED: Any = (0, (4, 1.6))
LEGEND: dict[str, Any] = {"frameon": False, "fontsize": 9, "handlelength": 2.4}


Signals = Sequence[tuple[float, str]]  # time [s], note


def time_figure(
    logs: Sequence[TrialLog],
    *,
    title: str,
    d_min: float,
    buffer: float,
    signals: Signals = (),
    links: Sequence[str] = (),
    faults: Sequence[tuple[float, float]] = (),
) -> Figure:
    """Distance, activation and link of the control point over time, all controllers in one.

    The form of [WA] Figs. 7 and 8, with the true distance (dashed) beside the seen one (solid).

    Args:
        logs: trials of one scenario, one per controller.
        title: above the figure.
        d_min: distance that the avoidance keeps [m].
        buffer: Delta, over which its activation rises [m].
        signals: vertical lines through all of it.
        links: the robot's, whose order fixes their colours; left out: as they come.
        faults: start and end of each [s], shaded through all of it.
    """
    figure = Figure(figsize=(7.2, 6.0), dpi=DPI, layout=ConstrainedLayoutEngine(h_pad=0.1))
    FigureCanvasAgg(figure)
    figure.suptitle(title, fontsize=12, fontweight="bold")
    held = any((log.mode > 0).any() for log in logs)
    band = 0.32 * len(logs) + 0.1
    heights = (3.4, 1.5, band, band) if held else (3.4, 1.5, band)
    axes = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
    _distances(axes[0], logs, d_min, buffer)
    _activations(axes[1], logs)
    _links(axes[2], logs, links)
    shaded = _modes(axes[3], logs) if held else []
    for start, end in faults:
        for ax in axes:
            ax.axvspan(start, end, color=GREY, alpha=0.15, linewidth=0.0, zorder=0)
    if faults:
        shaded.append(Patch(color=GREY, alpha=0.15, label="fault"))
    if shaded:
        names = [str(patch.get_label()) for patch in shaded]
        place: dict[str, Any] = {"loc": "upper right", "handlelength": 1.4, "fontsize": 8}
        # Beside the axes' own legend, which keeps its room above them.
        axes[0].add_artist(Legend(axes[0], shaded, names, frameon=False, **place))
    mark_signals(axes, signals)
    axes[-1].set_xlabel("time [s]", fontsize=10)
    axes[-1].set_xlim(0.0, max(_end(log) for log in logs))
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
        colour, width = COLOURS.get(log.controller, "black"), _width(log.controller)
        true, seen = _gaps(log.true_m), _gaps(log.seen_m)
        if log.controller != "wb_known":  # there the two hardly differ: one line says it
            ax.plot(log.time, seen, color=colour, linewidth=width, zorder=_order(log.controller))
        ax.plot(
            log.time, true, color=colour, linewidth=width, linestyle=DASHED,
            zorder=_order(log.controller),
        )  # fmt: skip
        highest = max([highest, *true[np.isfinite(true)], *seen[np.isfinite(seen)]])
    ax.set_ylim(0.0, 1.06 * highest)
    ax.set_ylabel("minimum distance [m]", fontsize=10)
    handles, labels = [], []
    for log in logs:
        dash: Any = DASHED if log.controller == "wb_known" else "-"
        width = 1.4 * _width(log.controller)
        colour = COLOURS.get(log.controller, "black")
        handles.append(Line2D([], [], color=colour, linewidth=width, linestyle=dash))
        labels.append(NAMES.get(log.controller, log.controller))
    handles.append(Line2D([], [], color=GREY, linewidth=1.6))
    handles.append(Line2D([], [], color=GREY, linewidth=1.6, linestyle=DASHED))
    place: dict[str, Any] = {
        "loc": "lower center",
        "bbox_to_anchor": (0.5, 1.0),
        "ncols": len(handles),
    }
    ax.legend(handles, [*labels, "seen", "true"], columnspacing=1.4, **place, **LEGEND)


def mark_signals(axes: Iterable[Axes], signals: Signals) -> None:
    """Vertical lines through all axes, with their notes along them in the first."""
    for row, ax in enumerate(axes):
        for at, note in signals:
            ax.axvline(at, color=GREY, linewidth=0.8, alpha=0.6, zorder=1)
            if row == 0:
                ax.annotate(
                    note, (at, 1.0), xycoords=("data", "axes fraction"), xytext=(2, -3),
                    textcoords="offset points", fontsize=7, color=GREY, rotation=90, ha="left",
                    va="top", zorder=1,
                )  # fmt: skip


def _width(controller: str) -> float:
    """The whole body's lies under the others', wide enough to be seen on both sides."""
    return {"wb": 1.9, "wb_known": 1.0}.get(controller, 1.0)


def _order(controller: str) -> float:
    return 2.0 if controller == "wb" else 3.0


def _gaps(distance: Array) -> Array:
    """Distances to nothing are gaps in the curve."""
    return np.where(np.isfinite(distance), distance, np.nan)


def _activations(ax: Axes, logs: Sequence[TrialLog]) -> None:
    for log in logs:
        colour = COLOURS.get(log.controller, "black")
        ax.plot(
            log.time, log.activation, color=colour, linewidth=_width(log.controller),
            zorder=_order(log.controller),
        )  # fmt: skip
    ax.set_ylim(-0.05, 1.08)
    ax.set_yticks((0.0, 0.5, 1.0))
    ax.set_ylabel("activation [-]", fontsize=10)


def _modes(ax: Axes, logs: Sequence[TrialLog]) -> list[Patch]:
    """One band a controller, coloured where it is not in RUN; the colours that are there."""
    met: set[int] = set()
    for row, log in enumerate(reversed(logs)):
        for mode, start, end in _stretches(log, log.mode):
            if mode > 0:
                met.add(int(mode))
                ax.broken_barh(
                    [(start, end - start)], (row - 0.38, 0.76), facecolors=MODE_COLOURS[int(mode)]
                )
    ax.set_yticks(range(len(logs)), [log.controller for log in reversed(logs)])
    ax.set_ylim(-0.6, len(logs) - 0.4)
    ax.set_ylabel("mode", fontsize=10)
    return [Patch(color=MODE_COLOURS[mode], label=modes.NAMES[mode]) for mode in sorted(met)]


def _links(ax: Axes, logs: Sequence[TrialLog], links: Sequence[str]) -> None:
    """One band a controller, coloured and labelled by the link that the avoidance moves."""
    order: list[str] = []
    for log in logs:
        order += [link for link in dict.fromkeys(log.control_link) if link and link not in order]
    known = [*links, *(link for link in order if link not in links)]
    order.sort(key=known.index)
    colours = {link: BANDS[known.index(link) % len(BANDS)] for link in order}
    duration = max(_end(log) for log in logs)
    told: set[str] = set()
    for row, log in enumerate(reversed(logs)):
        for link, start, end in _spans(log):
            colour = colours[link]
            ax.broken_barh([(start, end - start)], (row - 0.38, 0.76), facecolors=colour)
            if end - start > 0.0115 * duration * len(link):  # else the text would not fit
                ax.text((start + end) / 2, row, link, ha="center", va="center", fontsize=7.5)
                told.add(link)
    if any(link not in told for link in order) and isinstance(ax.figure, Figure):
        patches = [Patch(color=colours[link]) for link in order]
        ax.figure.legend(patches, order, loc="outside lower center", ncols=4, **LEGEND)
    ax.set_yticks(range(len(logs)), [log.controller for log in reversed(logs)])
    ax.set_ylim(-0.6, len(logs) - 0.4)
    ax.set_ylabel("control\npoint on", fontsize=10)


def _end(log: TrialLog) -> float:
    """When the last tick's command ends [s]."""
    return float(log.time[-1] + (log.time[-1] - log.time[-2] if len(log.time) > 1 else 0.0))


def _spans(log: TrialLog) -> Iterator[tuple[str, float, float]]:
    """(link, start, end) of every stretch of time with the same link, those with none left out."""
    for link, start, end in _stretches(log, np.asarray(log.control_link)):
        if link:
            yield str(link), start, end


def _stretches(log: TrialLog, values: NDArray[Any]) -> Iterator[tuple[Any, float, float]]:
    """(value, start, end) of every stretch of time with the same value."""
    starts = np.flatnonzero(np.r_[True, values[1:] != values[:-1]])
    ends = np.r_[log.time[starts[1:]], _end(log)]
    for start, end in zip(starts, ends, strict=True):
        yield values[start], float(log.time[start]), float(end)


def png(figure: Figure) -> bytes:
    """The figure as a PNG file's bytes, the same for the same figure."""
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        # A short run's notes are wider than its axes: they overlap, and the figure is as it was.
        warnings.filterwarnings("ignore", "constrained_layout not applied", UserWarning)
        figure.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})
    return buffer.getvalue()

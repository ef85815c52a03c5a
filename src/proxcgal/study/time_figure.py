"""Trials over time, in the form of the paper's Figs. 7 and 8."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from proxcgal.core import modes
from proxcgal.core.typing import Array
from proxcgal.evaluation.trial_log import TrialLog
from proxcgal.study.plotting import (
    CONTROLLER_COLOURS,
    CONTROLLER_NAMES,
    DASHED,
    GREY,
    LEGEND,
    Signals,
    mark_signals,
    mark_thresholds,
    new_figure,
    tidy_axes,
)

BANDS = ("#56B4E9", "#F0E442", "#CC79A7", "#E69F00", "#9BD8C2", "#B9B9E8", "#D9C6A5", "#C7C7C7")
#: The monitor's modes but RUN, in colours that no controller has.
MODE_COLOURS = {modes.DEGRADED: "#F0E442", modes.HOLD: "#CC79A7", modes.STOP: "#333333"}


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
    figure = new_figure(7.2, 6.0, title, layout=ConstrainedLayoutEngine(h_pad=0.1))
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
    axes[-1].set(xlabel="time [s]", xlim=(0.0, max(_end(log) for log in logs)))
    tidy_axes(*axes)
    return figure


def _distances(ax: Axes, logs: Sequence[TrialLog], d_min: float, buffer: float) -> None:
    mark_thresholds(ax, d_min, buffer, offset=5, fontsize=9, zorder=1)
    highest = d_min + buffer
    for log in logs:
        colour, width = CONTROLLER_COLOURS.get(log.controller, "black"), _width(log.controller)
        true, seen = _gaps(log.true_m), _gaps(log.seen_m)
        if log.controller != "wb_known":  # there the two hardly differ: one line says it
            ax.plot(log.time, seen, color=colour, linewidth=width, zorder=_order(log.controller))
        ax.plot(
            log.time, true, color=colour, linewidth=width, linestyle=DASHED,
            zorder=_order(log.controller),
        )  # fmt: skip
        highest = max([highest, *true[np.isfinite(true)], *seen[np.isfinite(seen)]])
    ax.set(ylim=(0.0, 1.06 * highest), ylabel="minimum distance [m]")
    handles, labels = [], []
    for log in logs:
        dash: Any = DASHED if log.controller == "wb_known" else "-"
        width = 1.4 * _width(log.controller)
        colour = CONTROLLER_COLOURS.get(log.controller, "black")
        handles.append(Line2D([], [], color=colour, linewidth=width, linestyle=dash))
        labels.append(CONTROLLER_NAMES.get(log.controller, log.controller))
    handles.append(Line2D([], [], color=GREY, linewidth=1.6))
    handles.append(Line2D([], [], color=GREY, linewidth=1.6, linestyle=DASHED))
    place: dict[str, Any] = {
        "loc": "lower center",
        "bbox_to_anchor": (0.5, 1.0),
        "ncols": len(handles),
    }
    ax.legend(handles, [*labels, "seen", "true"], columnspacing=1.4, **place, **LEGEND)


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
        colour = CONTROLLER_COLOURS.get(log.controller, "black")
        ax.plot(
            log.time, log.activation, color=colour, linewidth=_width(log.controller),
            zorder=_order(log.controller),
        )  # fmt: skip
    ax.set(ylim=(-0.05, 1.08), yticks=(0.0, 0.5, 1.0), ylabel="activation [-]")


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
    _label_bands(ax, logs, "mode")
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
    labelled: set[str] = set()
    for row, log in enumerate(reversed(logs)):
        for link, start, end in _spans(log):
            colour = colours[link]
            ax.broken_barh([(start, end - start)], (row - 0.38, 0.76), facecolors=colour)
            if end - start > 0.0115 * duration * len(link):  # else the text would not fit
                ax.text((start + end) / 2, row, link, ha="center", va="center", fontsize=7.5)
                labelled.add(link)
    if any(link not in labelled for link in order) and isinstance(ax.figure, Figure):
        patches = [Patch(color=colours[link]) for link in order]
        ax.figure.legend(patches, order, loc="outside lower center", ncols=4, **LEGEND)
    _label_bands(ax, logs, "control\npoint on")


def _label_bands(ax: Axes, logs: Sequence[TrialLog], name: str) -> None:
    ax.set_yticks(range(len(logs)), [log.controller for log in reversed(logs)])
    ax.set(ylim=(-0.6, len(logs) - 0.4), ylabel=name)


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

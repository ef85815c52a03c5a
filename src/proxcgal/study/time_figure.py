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
        # Beside the axes' own legend, which keeps its room above them.
        axes[0].add_artist(
            Legend(
                axes[0],
                shaded,
                [str(patch.get_label()) for patch in shaded],
                loc="upper right",
                frameon=False,
                handlelength=1.4,
                fontsize=8,
            )
        )
    mark_signals(axes, signals)
    axes[-1].set(xlabel="time [s]", xlim=(0.0, max(_end(log) for log in logs)))
    tidy_axes(*axes)
    return figure


def _distances(ax: Axes, logs: Sequence[TrialLog], d_min: float, buffer: float) -> None:
    mark_thresholds(ax, d_min, buffer, offset=5, fontsize=9, zorder=1)
    highest, handles = d_min + buffer, []
    for log in logs:
        style, known = _style(log), log.controller == "wb_known"
        true, seen = _gaps(log.true_m), _gaps(log.seen_m)
        if not known:  # there the two hardly differ: one line says it
            ax.plot(log.time, seen, **style)
        ax.plot(log.time, true, linestyle=DASHED, **style)
        highest = max([highest, *true[np.isfinite(true)], *seen[np.isfinite(seen)]])
        handles.append(
            Line2D(
                [], [], color=style["color"], linewidth=1.4 * style["linewidth"],
                linestyle=DASHED if known else "-",
                label=CONTROLLER_NAMES.get(log.controller, log.controller),
            )
        )  # fmt: skip
    ax.set(ylim=(0.0, 1.06 * highest), ylabel="minimum distance [m]")
    handles += [
        Line2D([], [], color=GREY, linewidth=1.6, label="seen"),
        Line2D([], [], color=GREY, linewidth=1.6, linestyle=DASHED, label="true"),
    ]
    ax.legend(
        handles=handles,
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=len(handles),
        columnspacing=1.4,
        **LEGEND,
    )


def _style(log: TrialLog) -> dict[str, Any]:
    """The whole body's lies under the others', wide enough to be seen on both sides."""
    width, order = (1.9, 2.0) if log.controller == "wb" else (1.0, 3.0)
    colour = CONTROLLER_COLOURS.get(log.controller, "black")
    return {"color": colour, "linewidth": width, "zorder": order}


def _gaps(distance: Array) -> Array:
    """Distances to nothing are gaps in the curve."""
    return np.where(np.isfinite(distance), distance, np.nan)


def _activations(ax: Axes, logs: Sequence[TrialLog]) -> None:
    for log in logs:
        ax.plot(log.time, log.activation, **_style(log))
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
    met = dict.fromkeys(link for log in logs for link in log.control_link if link)
    known = dict.fromkeys([*links, *met])
    colours = {link: BANDS[k % len(BANDS)] for k, link in enumerate(known) if link in met}
    duration = max(_end(log) for log in logs)
    labelled: set[str] = set()
    for row, log in enumerate(reversed(logs)):
        for link, start, end in _stretches(log, np.asarray(log.control_link)):
            if not link:
                continue
            ax.broken_barh([(start, end - start)], (row - 0.38, 0.76), facecolors=colours[link])
            if end - start > 0.0115 * duration * len(link):  # else the text would not fit
                ax.text((start + end) / 2, row, link, ha="center", va="center", fontsize=7.5)
                labelled.add(link)
    if colours.keys() - labelled and isinstance(ax.figure, Figure):
        patches = [Patch(color=colour, label=link) for link, colour in colours.items()]
        ax.figure.legend(handles=patches, loc="outside lower center", ncols=4, **LEGEND)
    _label_bands(ax, logs, "control\npoint on")


def _label_bands(ax: Axes, logs: Sequence[TrialLog], name: str) -> None:
    ax.set_yticks(range(len(logs)), [log.controller for log in reversed(logs)])
    ax.set(ylim=(-0.6, len(logs) - 0.4), ylabel=name)


def _end(log: TrialLog) -> float:
    """When the last tick's command ends [s]."""
    return float(log.time[-1] + (log.time[-1] - log.time[-2] if len(log.time) > 1 else 0.0))


def _stretches(log: TrialLog, values: NDArray[Any]) -> Iterator[tuple[Any, float, float]]:
    """(value, start, end) of every stretch of time with the same value."""
    starts = np.flatnonzero(np.r_[True, values[1:] != values[:-1]])
    ends = np.r_[log.time[starts[1:]], _end(log)]
    for start, end in zip(starts, ends, strict=True):
        yield values[start], float(log.time[start]), float(end)

"""What all figures share: colours, names, axes, and the PNG file."""

import io
import warnings
from collections.abc import Iterable, Sequence
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

DPI = 160
# Okabe and Ito's palette: distinct with any colour vision, and in print by lightness.
CONTROLLER_COLOURS = {
    "wb": "#0072B2", "sm": "#D55E00", "wb_known": "#009E73", "wb_memory": "#E69F00"
}  # fmt: skip
CONTROLLER_NAMES = {
    "wb": "whole body (WB)",
    "sm": "sensor points (SM)",
    "wb_known": "WB, scene known",
    "wb_memory": "WB, memory",
}
GREY = "#5A5A5A"
DASHED: Any = (0, (4, 1.6))
DOTTED: Any = (0, (1, 1.5))
LEGEND: dict[str, Any] = {"frameon": False, "fontsize": 9, "handlelength": 2.4}

Signals = Sequence[tuple[float, str]]  # time [s], note


def new_figure(
    width: float, height: float, title: str = "", *, layout: Any = "constrained", **place: Any
) -> Figure:
    """An empty figure that needs no display.

    Args:
        width: [in]
        height: [in]
        title: above it; none where it is empty.
        layout: how matplotlib places the axes; None: not at all.
        place: of the title, as matplotlib takes it.
    """
    figure = Figure(figsize=(width, height), dpi=DPI, layout=layout)
    FigureCanvasAgg(figure)
    if title:
        figure.suptitle(title, fontsize=12, fontweight="bold", **place)
    return figure


def tidy_axes(*axes: Axes) -> None:
    """Small numbers, and no frame at the top and on the right."""
    for ax in axes:
        ax.tick_params(labelsize=9)
        ax.spines[["top", "right"]].set_visible(False)


def legend_below(figure: Figure, handles: Sequence[Artist], *, rows: int = 1) -> None:
    """Explains the labelled handles below all axes."""
    figure.legend(
        handles=handles, loc="outside lower center", ncols=-(-len(handles) // rows), **LEGEND
    )


def mark_thresholds(
    ax: Axes, d_min: float, buffer: float, *, offset: float, fontsize: float, **style: Any
) -> None:
    """Level lines at the distances between which the avoidance's activation rises, with names.

    Args:
        ax: of distances [m].
        d_min: distance that the avoidance keeps [m].
        buffer: Delta [m].
        offset: of the names from the axes [pt].
        fontsize: of the names [pt].
        style: of the lines, as matplotlib takes it.
    """
    for level, label in ((d_min, r"$d_{min}$"), (d_min + buffer, r"$d_{min}+\Delta$")):
        ax.axhline(level, color=GREY, linewidth=1.0, linestyle=DOTTED, **style)
        ax.annotate(
            label, (1.0, level), xycoords=("axes fraction", "data"), xytext=(offset, 0),
            textcoords="offset points", va="center", fontsize=fontsize, color=GREY,
        )  # fmt: skip


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


def png(figure: Figure) -> bytes:
    """The figure as a PNG file's bytes, the same for the same figure."""
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        # A short run's notes are wider than its axes: they overlap, and the figure is as it was.
        warnings.filterwarnings("ignore", "constrained_layout not applied", UserWarning)
        figure.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})
    return buffer.getvalue()

"""Distributions over drawn scenes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import polars as pl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from proxcgal.evaluation.trial_log import TOO_CLOSE
from proxcgal.study.bootstrap import median_interval
from proxcgal.study.figures import COLOURS, DASHED, DPI, GREY, LEGEND, NAMES
from proxcgal.study.paired import Ends, Pairs, ends_of, pairs
from proxcgal.study.static.memory_share import MEASURES, WORSE_MM, Shares, shares

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DOTTED: Any = (0, (1, 1.5))
_GAIN, _COST = "#333333", "#CC79A7"


def scene_figure(scene: str, table: pl.DataFrame) -> Figure:
    """Ends of all controllers, pairs of wb and sm, differences: over the draws of one scene.

    Args:
        scene: its name, above the figure.
        table: its trials; those that failed, or see no panel, are left out.
    """
    ends = ends_of(table)
    figure = Figure(figsize=(10.2, 3.7), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(
        f"{scene}: {table['draw'].n_unique()} random scenes", fontsize=12, fontweight="bold"
    )
    axes = figure.subplots(1, 3, width_ratios=(1.1, 1.0, 1.1))
    _ends(axes[0], ends)
    _pairs(axes[1], pairs(ends, "wb", "sm"))
    _differences(axes[2], ends)
    for letter, ax in zip("abc", axes, strict=True):
        ax.tick_params(labelsize=9)
        ax.spines[["top", "right"]].set_visible(False)
        ax.set_title(f"({letter})", loc="left", fontsize=10)
    lines = [line for ax in axes[::2] for line in ax.get_legend_handles_labels()[0]]
    figure.legend(
        lines, [str(line.get_label()) for line in lines], loc="outside lower center",
        ncols=(len(lines) + 1) // 2, columnspacing=1.6, **LEGEND,
    )  # fmt: skip
    return figure


def memory_figure(scene: str, table: pl.DataFrame) -> Figure:
    """What memory regains over what sensing costs, per draw: at the end, and at the nearest.

    Args:
        scene: its name, above the figure.
        table: its trials.
    """
    figure = Figure(figsize=(7.6, 4.3), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(f"{scene}: memory against the cost of sensing", fontsize=12, fontweight="bold")
    titles = ("(a) at the end", "(b) at the nearest")
    for ax, measure, title in zip(figure.subplots(1, 2), MEASURES, titles, strict=True):
        _regained(ax, shares(table, measure))
        ax.set_title(title, loc="left", fontsize=10)
        ax.tick_params(labelsize=9)
        ax.spines[["top", "right"]].set_visible(False)
    return figure


def _regained(ax: Axes, of: Shares) -> None:
    all_mm = [-WORSE_MM, 50.0, *of.lost, *of.regained]
    low, high = min(all_mm) - 10.0, max(all_mm) + 10.0
    ax.plot((low, high), (low, high), color=GREY, linewidth=1.0)
    ax.axhline(0.0, color=GREY, linewidth=1.0)
    ax.axhline(-WORSE_MM, color=GREY, linewidth=1.0, linestyle=_DOTTED)
    ax.scatter(of.lost, of.regained, s=14, color=COLOURS["wb_memory"], alpha=0.6, linewidths=0.0)
    ax.set_xlim(low, high)
    ax.set_ylim(low, high)
    ax.set_aspect("equal")
    ax.set_xlabel("cost of sensing, known - WB [mm]", fontsize=10)
    ax.set_ylabel("regained, memory - WB [mm]", fontsize=10)


def _ends(ax: Axes, ends: Ends) -> None:
    for name, by_draw in ends.items():
        ax.ecdf(
            list(by_draw.values()), color=COLOURS.get(name, "black"), label=NAMES.get(name, name),
            linewidth=1.6, linestyle=DASHED if name == "wb_memory" else "-",
        )  # fmt: skip
    ax.axvline(TOO_CLOSE, color=GREY, linewidth=1.0, linestyle=_DOTTED)
    ax.set_xlim(left=0.0)
    ax.set_xlabel("true distance at the end [m]", fontsize=10)
    ax.set_ylabel("share of draws [-]", fontsize=10)


def _pairs(ax: Axes, both: Pairs) -> None:
    top = 1.05 * max([0.1, *both.one, *both.other])
    ax.plot((0.0, top), (0.0, top), color=GREY, linewidth=1.0, linestyle=_DOTTED)
    ax.scatter(both.other, both.one, s=14, color=COLOURS["wb"], alpha=0.6, linewidths=0.0)
    ax.set_xlim(0.0, top)
    ax.set_ylim(0.0, top)
    ax.set_aspect("equal")
    ax.set_xlabel("sm, true distance at the end [m]", fontsize=10)
    ax.set_ylabel("wb, true distance at the end [m]", fontsize=10)


def _differences(ax: Axes, ends: Ends) -> None:
    for one, other, colour, label in (
        ("wb", "sm", _GAIN, "gain, WB - SM"),
        ("wb_known", "wb", _COST, "cost of sensing, known - WB"),
        ("wb_memory", "wb", COLOURS["wb_memory"], "memory - WB"),
    ):
        apart = pairs(ends, one, other).apart_mm
        interval = median_interval(apart)
        if interval is not None:
            ax.ecdf(apart, color=colour, label=label, linewidth=1.6)
            ax.axvspan(interval.low, interval.high, color=colour, alpha=0.18, linewidth=0.0)
    ax.axvline(0.0, color=GREY, linewidth=1.0, linestyle=_DOTTED)
    ax.set_xlabel("difference at the end [mm]", fontsize=10)
    ax.set_ylabel("share of draws [-]", fontsize=10)

"""Distributions over drawn scenes."""

import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from proxcgal.evaluation.metrics import Summary
from proxcgal.evaluation.trial_log import TOO_CLOSE
from proxcgal.study.bootstrap import Distances, Pairs, draw_distances, median_interval, pairs
from proxcgal.study.campaign import file_name
from proxcgal.study.plotting import (
    CONTROLLER_COLOURS,
    CONTROLLER_NAMES,
    DASHED,
    DOTTED,
    GREY,
    LEGEND,
    new_figure,
    tidy_axes,
)
from proxcgal.study.static.memory_share import MEASURES, WORSE_MM, Shares, shares

_GAIN, _COST = "#333333", "#CC79A7"


def figures(table: pl.DataFrame, _: Summary | None = None) -> dict[str, Figure]:
    """Two a scene: distributions at the end, pairs, differences; what memory gives back."""
    drawn: dict[str, Figure] = {}
    for (scene,), own in table.group_by(["scene"], maintain_order=True):
        drawn[file_name(f"{scene}.png")] = scene_figure(str(scene), own)
        drawn[file_name(f"{scene}_memory.png")] = memory_figure(str(scene), own)
    return drawn


def scene_figure(scene: str, table: pl.DataFrame) -> Figure:
    """Distances of all controllers, pairs of wb and sm, differences: over the draws of one scene.

    Args:
        scene: its name, above the figure.
        table: its trials; those that failed, or see no panel, are left out.
    """
    ends = draw_distances(table)
    figure = new_figure(10.2, 3.7, f"{scene}: {table['draw'].n_unique()} random scenes")
    axes = figure.subplots(1, 3, width_ratios=(1.1, 1.0, 1.1))
    _ends(axes[0], ends)
    _pairs(axes[1], pairs(ends, "wb", "sm"))
    _differences(axes[2], ends)
    for letter, ax in zip("abc", axes, strict=True):
        tidy_axes(ax)
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
    figure = new_figure(7.6, 4.3, f"{scene}: memory against the cost of sensing")
    titles = ("(a) at the end", "(b) at the nearest")
    for ax, measure, title in zip(figure.subplots(1, 2), MEASURES, titles, strict=True):
        _regained(ax, shares(table, measure))
        ax.set_title(title, loc="left", fontsize=10)
        tidy_axes(ax)
    return figure


def _regained(ax: Axes, of: Shares) -> None:
    all_mm = [-WORSE_MM, 50.0, *of.lost, *of.regained]
    low, high = min(all_mm) - 10.0, max(all_mm) + 10.0
    ax.plot((low, high), (low, high), color=GREY, linewidth=1.0)
    ax.axhline(0.0, color=GREY, linewidth=1.0)
    ax.axhline(-WORSE_MM, color=GREY, linewidth=1.0, linestyle=DOTTED)
    ax.scatter(
        of.lost, of.regained, s=14, color=CONTROLLER_COLOURS["wb_memory"], alpha=0.6, linewidths=0.0
    )
    ax.set(
        xlim=(low, high),
        ylim=(low, high),
        aspect="equal",
        xlabel="cost of sensing, known - WB [mm]",
        ylabel="regained, memory - WB [mm]",
    )


def _ends(ax: Axes, ends: Distances) -> None:
    for name, by_draw in ends.items():
        ax.ecdf(
            list(by_draw.values()), color=CONTROLLER_COLOURS.get(name, "black"),
            label=CONTROLLER_NAMES.get(name, name), linewidth=1.6,
            linestyle=DASHED if name == "wb_memory" else "-",
        )  # fmt: skip
    ax.axvline(TOO_CLOSE, color=GREY, linewidth=1.0, linestyle=DOTTED)
    ax.set(xlim=(0.0, None), xlabel="true distance at the end [m]", ylabel="share of draws [-]")


def _pairs(ax: Axes, both: Pairs) -> None:
    top = 1.05 * max([0.1, *both.one, *both.other])
    ax.plot((0.0, top), (0.0, top), color=GREY, linewidth=1.0, linestyle=DOTTED)
    ax.scatter(
        both.other, both.one, s=14, color=CONTROLLER_COLOURS["wb"], alpha=0.6, linewidths=0.0
    )
    ax.set(
        xlim=(0.0, top),
        ylim=(0.0, top),
        aspect="equal",
        xlabel="sm, true distance at the end [m]",
        ylabel="wb, true distance at the end [m]",
    )


def _differences(ax: Axes, ends: Distances) -> None:
    for one, other, colour, label in (
        ("wb", "sm", _GAIN, "gain, WB - SM"),
        ("wb_known", "wb", _COST, "cost of sensing, known - WB"),
        ("wb_memory", "wb", CONTROLLER_COLOURS["wb_memory"], "memory - WB"),
    ):
        apart = pairs(ends, one, other).apart_mm
        interval = median_interval(apart)
        if interval is not None:
            ax.ecdf(apart, color=colour, label=label, linewidth=1.6)
            ax.axvspan(interval.low, interval.high, color=colour, alpha=0.18, linewidth=0.0)
    ax.axvline(0.0, color=GREY, linewidth=1.0, linestyle=DOTTED)
    ax.set(xlabel="difference at the end [mm]", ylabel="share of draws [-]")

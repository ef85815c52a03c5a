"""Figures of the human study: Fig. 9 of the paper, courses, distributions, differences."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import polars as pl
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from proxcgal.evaluation.metrics import Summary
from proxcgal.study.bootstrap import mean_interval, pairs
from proxcgal.study.hri.metrics import (
    SAMPLE_S,
    compared,
    phase_rows,
    series,
    subject_means,
)
from proxcgal.study.plotting import (
    CONTROLLER_COLOURS,
    CONTROLLER_NAMES,
    DASHED,
    DOTTED,
    GREY,
    legend_below,
    mark_signals,
    mark_thresholds,
    new_figure,
    tidy_axes,
)

Paper = Mapping[str, Mapping[str, tuple[float, float]]]  # mean and sigma_max [m]
_HIGHEST = 1.35  # [m] of a distance axis: beyond the sensors' workspace
_LABELS = {
    "task1": "Task 1", "task2": "Task 2", "H3_first": "H3, first run",
    "H3_second": "H3, second run",
}  # fmt: skip
#: The paper's two are drawn over the others, which lie close to WB.
_OVER = {"sm": 3, "wb": 4}


def figures(table: pl.DataFrame, summary: Summary | None = None) -> dict[str, Figure]:
    """By file; none where every trial failed. The summary says which rows the paper has."""
    done = table.filter(pl.col("error").is_null())
    main = done.filter(pl.col("layout") == "main")
    if main.is_empty():
        return {}
    paper = compared(summary or {})
    return {
        "trials.png": _trials(main),
        "cycles.png": _cycles(main),
        "subjects.png": _subjects(main, paper),
        "differences.png": _differences(done, paper),
    }


def _trials(main: pl.DataFrame) -> Figure:
    """[WA] Fig. 9: a trial with the baseline and one with the whole body."""
    task = main["task"].unique(maintain_order=True).to_list()[-1]
    own = main.filter(pl.col("task") == task)
    names = [n for n in ("sm", "wb") if n in own["controller"].to_list()]
    names = names or own["controller"].unique(maintain_order=True).to_list()[:2]
    met = [set(own.filter(pl.col("controller") == name)["subject"]) for name in names]
    both = set.intersection(*met)
    if not both:  # each with other subjects: one controller alone can be shown
        names, both = names[:1], met[0]
    subject = min(both)
    figure = new_figure(5.2 * len(names), 5.0, f"{_LABELS.get(task, task)}, subject {subject}")
    grid = figure.subplots(
        2, len(names), sharex=True, sharey="row", height_ratios=(2.6, 1.0), squeeze=False
    )
    for column, name in enumerate(names):
        trial = own.filter(pl.col("controller") == name, pl.col("subject") == subject)
        _trial(grid[:, column], trial, name, "abcd"[column])
    grid[0, 0].set_ylabel("minimum distance [m]", fontsize=10)
    grid[1, 0].set_ylabel("activation [-]", fontsize=10)
    styles: tuple[tuple[str, Any], ...] = (("seen", "-"), ("true", DASHED))
    legend_below(
        figure,
        [Line2D([], [], color=GREY, linewidth=1.4, linestyle=s, label=n) for n, s in styles],
    )
    return figure


def _trial(axes: Any, trial: pl.DataFrame, name: str, letter: str) -> None:
    top, bottom = axes
    tidy_axes(top, bottom)
    colour = CONTROLLER_COLOURS.get(name, "black")
    seen, true = series(trial, "seen_m")[0], series(trial, "true_m")[0]
    time = np.arange(len(seen)) * SAMPLE_S
    d_min, buffer = float(trial["d_min_m"][0]), float(trial["buffer_m"][0])
    mark_thresholds(top, d_min, buffer, offset=3, fontsize=8)
    top.fill_between(
        time, 0.0, 1.0, where=~np.isfinite(seen), transform=top.get_xaxis_transform(),
        color=GREY, alpha=0.12, linewidth=0.0,
    )  # fmt: skip
    top.plot(time, seen, color=colour, linewidth=1.2)
    top.plot(time, true, color=colour, linewidth=1.2, linestyle=DASHED)
    top.set_ylim(0.0, _HIGHEST)
    top.set_title(f"({letter}) {CONTROLLER_NAMES.get(name, name)}", loc="left", fontsize=10)
    bottom.plot(time, series(trial, "activation")[0], color=colour, linewidth=1.2)
    bottom.set(ylim=(-0.05, 1.08), xlim=(0.0, time[-1]), xlabel="time [s]")
    mark_signals((top, bottom), json.loads(trial["signals"][0]))


def _cycles(main: pl.DataFrame) -> Figure:
    tasks = main["task"].unique(maintain_order=True).to_list()
    figure = new_figure(8.4, 3.1 * len(tasks) + 0.3)
    axes = figure.subplots(len(tasks), 1, sharex=True, squeeze=False)[:, 0]
    tidy_axes(*axes)
    for ax, task in zip(axes, tasks, strict=True):
        own = main.filter(pl.col("task") == task)
        for (name,), part in own.group_by(["controller"], maintain_order=True):
            true = series(part, "true_m")
            time = np.arange(true.shape[1]) * SAMPLE_S
            mean, colour = true.mean(axis=0), CONTROLLER_COLOURS.get(str(name), "black")
            over = _OVER.get(str(name), 2)
            ax.plot(
                time, mean, color=colour, linewidth=1.6 if over > 2 else 1.0, zorder=over,
                label=CONTROLLER_NAMES.get(str(name), str(name)),
            )  # fmt: skip
            if over > 2 and len(true) > 1:
                spread = true.std(axis=0, ddof=1)  # as sigma_max of the tables
                ax.fill_between(
                    time, mean - spread, mean + spread, color=colour, alpha=0.16, linewidth=0.0
                )
        ax.set(ylim=(0.0, _HIGHEST), xlim=(0.0, time[-1]), ylabel="true distance [m]")
        ax.set_title(_LABELS.get(task, task), loc="left", fontsize=10, fontweight="bold")
        mark_signals((ax,), json.loads(own["signals"][0]))
    axes[-1].set_xlabel("time [s]", fontsize=10)
    legend_below(figure, axes[0].get_legend_handles_labels()[0])
    return figure


def _subjects(main: pl.DataFrame, paper: Paper) -> Figure:
    rows = phase_rows(main)
    names = main["controller"].unique(maintain_order=True).to_list()
    figure = new_figure(max(1.45 * len(rows) + 2.0, 8.6), 3.9)
    ax = figure.subplots()
    tidy_axes(ax)
    for place, row in enumerate(rows):
        for at, name in enumerate(names):
            x = place + 0.8 * ((at + 0.5) / len(names) - 0.5)
            values = np.array(list(subject_means(main, row).get(name, {}).values()))
            spread = np.linspace(-0.05, 0.05, len(values))
            colour = CONTROLLER_COLOURS.get(name, "black")
            ax.plot(x + spread, values, ".", color=colour, markersize=4, alpha=0.55)
            if len(values):
                ax.plot([x - 0.08, x + 0.08], [values.mean()] * 2, color=colour, linewidth=2.4)
            seen = list(subject_means(main, row, seen=True).get(name, {}).values())
            if seen:
                ax.plot([x], [np.mean(seen)], "D", color=colour, markersize=5, fillstyle="none")
            printed = paper.get(row, {}).get(name)
            if printed is not None:
                ax.plot([x], [printed[0]], "x", color="black", markersize=6)
    ax.set_xticks(range(len(rows)), [_LABELS.get(row, row) for row in rows])
    ax.set(ylim=(0.0, None), ylabel="mean distance of a subject [m]")
    handles = [
        Line2D(
            [], [], color=CONTROLLER_COLOURS.get(name, "black"), marker=".", linewidth=2.0,
            label=CONTROLLER_NAMES.get(name, name),
        )
        for name in names
    ]  # fmt: skip
    handles.append(
        Line2D([], [], color=GREY, marker="D", linestyle="", fillstyle="none", label="ours, seen")
    )
    if any(name in paper.get(row, {}) for row in rows for name in names):
        handles.append(_printed_handle("black"))
    legend_below(figure, handles)
    return figure


def _printed_handle(colour: str) -> Line2D:
    return Line2D([], [], color=colour, marker="x", linestyle="", label="the paper's (seen)")


def _differences(done: pl.DataFrame, paper: Paper) -> Figure:
    rows = phase_rows(done)
    layouts = done["layout"].unique(maintain_order=True).to_list()
    figure = new_figure(1.35 * len(rows) + 1.6, 3.7)
    ax = figure.subplots()
    tidy_axes(ax)
    colours = {"main": "#333333", "jittered": "#CC79A7"}
    for place, row in enumerate(rows):
        for at, layout in enumerate(layouts):
            own = done.filter(pl.col("layout") == layout)
            apart = pairs(subject_means(own, row), "wb", "sm").apart_mm
            interval = mean_interval(apart)
            if interval is None:
                continue
            x = place + 0.5 * ((at + 0.5) / len(layouts) - 0.5)
            ax.plot(
                x + np.linspace(-0.06, 0.06, len(apart)), apart, ".", color=colours[layout],
                markersize=4, alpha=0.4,
            )  # fmt: skip
            ax.errorbar(
                [x], [interval.middle],
                yerr=[[interval.middle - interval.low], [interval.high - interval.middle]],
                fmt="o", color=colours[layout], capsize=4, markersize=5, linewidth=1.6,
            )  # fmt: skip
        printed = paper.get(row)
        if printed is not None:
            ax.plot(
                [place], [1000.0 * (printed["wb"][0] - printed["sm"][0])], "x", color="#0072B2",
                markersize=7,
            )  # fmt: skip
    ax.axhline(0.0, color=GREY, linewidth=1.0, linestyle=DOTTED)
    ax.set_xticks(range(len(rows)), [_LABELS.get(row, row) for row in rows])
    ax.set_ylabel("WB \N{MINUS SIGN} SM, mean true distance [mm]", fontsize=10)
    names = {"main": "the cell as it is", "jittered": "positions moved"}
    handles = [
        Line2D([], [], color=colours[layout], marker="o", linestyle="", label=names[layout])
        for layout in layouts
    ]
    if any(row in paper for row in rows):
        handles.append(_printed_handle("#0072B2"))
    legend_below(figure, handles)
    return figure

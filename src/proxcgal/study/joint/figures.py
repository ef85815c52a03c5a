"""Runs of the 12-joint robot over time: macro against micro motion, activations, distance."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from proxcgal.evaluation.metrics import Summary
from proxcgal.evaluation.trial_log import TOO_CLOSE
from proxcgal.study.campaign import file_name
from proxcgal.study.plotting import DOTTED, GREY, LEGEND, new_figure, tidy_axes

Series = Mapping[str, Any]

_MACRO, _MICRO = "#E69F00", "#0072B2"
_TASKS = {
    "joint_limits": "#CC79A7",
    "avoidance": "#D55E00",
    "self_collision": "#56B4E9",
    "minimum_altitude": "#009E73",
    "manipulability_micro": "#8C8C8C",
    "manipulability_macro": "#333333",
}
#: Curves of distance: what the arm was given, its colour, its name.
_SEEN = {
    "known": ("#6A3D9A", "known"),
    "sensed": ("#0072B2", "sensed"),
    "memory": ("#CC79A7", "sensed with memory"),
}
NEAR_M = 0.6  # [m] distances beyond it are not shown


def figures(table: pl.DataFrame, _: Summary | None = None) -> dict[str, Figure]:
    """One a scene: a column for each start, of the first run of each kind."""
    found = {}
    for (scene,), own in table.group_by(["scene"], maintain_order=True):
        runs = [row for row in own.iter_rows(named=True)
                if row["stack"] == "full" and row["series"] is not None]  # fmt: skip
        if runs:
            found[f"{file_name(str(scene))}.png"] = joint_figure(str(scene), runs)
    return found


def joint_figure(scene: str, runs: Sequence[Mapping[str, Any]]) -> Figure:
    """Speeds and activations of the known run, true distances of all; a column for each start.

    Args:
        scene: its name, above the figure.
        runs: rows of the campaign's table with their `series`, all of the full stack.
    """
    starts = list(dict.fromkeys(str(run["init"]) for run in runs))
    figure = new_figure(max(4.9 * len(starts), 6.4), 6.6, f"{scene}, full stack")
    axes = figure.subplots(
        3, len(starts), sharex="col", sharey="row", squeeze=False, height_ratios=(1.3, 1.0, 1.3)
    )
    for column, start in enumerate(starts):
        own: dict[str, Series] = {}
        for run in runs:
            if run["init"] == start and run["perception"] not in own:
                own[str(run["perception"])] = json.loads(run["series"])
        axes[0, column].set_title(f"from {start}", fontsize=11)
        shown = own.get("known") or next(iter(own.values()))
        _speeds(axes[0, column], shown)
        _activations(axes[1, column], shown)
        _distances(axes[2, column], own)
        axes[2, column].set_xlabel("time [s]", fontsize=10)
    for row, name in enumerate(("speed at the tool [m/s]", "activation [-]", "true distance [m]")):
        axes[row, 0].set_ylabel(name, fontsize=10)
    tidy_axes(*axes.ravel())
    for ax in axes.ravel():
        ax.set_xlim(left=0.0)
    for row in range(3):
        lines = {
            str(line.get_label()): line
            for ax in axes[row]
            for line in ax.get_legend_handles_labels()[0]
        }
        if lines:
            axes[row, -1].legend(
                list(lines.values()), list(lines), loc="upper left", bbox_to_anchor=(1.0, 1.0),
                **LEGEND,
            )  # fmt: skip
    return figure


def _speeds(ax: Axes, series: Series) -> None:
    for key, colour, name in (
        ("macro", _MACRO, "KUKA (macro)"),
        ("micro", _MICRO, "UR10e (micro)"),
    ):
        ax.plot(series["time"], _gaps(series[key]), color=colour, linewidth=1.5, label=name)
    ax.set_ylim(bottom=0.0)


def _activations(ax: Axes, series: Series) -> None:
    for name, values in series["activation"].items():
        if name in _TASKS:
            ax.plot(
                series["time"], _gaps(values), color=_TASKS[name], linewidth=1.5,
                label=name.replace("_", " "),
            )  # fmt: skip
    ax.set(ylim=(-0.05, 1.08), yticks=(0.0, 0.5, 1.0))


def _distances(ax: Axes, own: Mapping[str, Series]) -> None:
    """True ones; a dot ends each run."""
    for key, (colour, name) in _SEEN.items():
        if key in own:
            true = _gaps(own[key]["true"])
            if np.isfinite(true).any():
                ax.plot(own[key]["time"], true, color=colour, linewidth=1.5, label=name)
                ax.plot(own[key]["time"][-1], true[-1], "o", color=colour, markersize=4)
    if ax.lines:
        ax.axhline(TOO_CLOSE, color=GREY, linewidth=1.0, linestyle=DOTTED, label="0.05 m")
        ax.set_ylim(0.0, NEAR_M)
    else:
        ax.text(
            0.5, 0.5, "no obstacle", transform=ax.transAxes, ha="center", color=GREY, fontsize=10
        )


def _gaps(values: Sequence[float | None]) -> Any:
    return np.array([np.nan if value is None else value for value in values])

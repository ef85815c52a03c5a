"""The blind volume round an arm, in two sections, and over time."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from proxcgal.core.transforms import placed
from proxcgal.core.typing import Array
from proxcgal.evaluation.blind_volume import REACH_M, BlindVolume, distances, last_seen
from proxcgal.scenario.setup import Setup
from proxcgal.study.plotting import DOTTED, GREY, legend_below, new_figure, tidy_axes

_STEP_M = 0.025  # between the points of a section
_ARM = "#6B6B6B"
#: In view, remembered, forgotten, never; beyond reach is left white.
_COLOURS = ("#CFE8D5", "#F7D58B", "#C9B3D9", "#C0504D")


def coverage_figure(
    setup: Setup,
    stamps: Sequence[float],
    postures: Sequence[Array],
    volume: BlindVolume,
    *,
    title: str,
    nearest_W: Array | None = None,
) -> Figure:
    """What was in view round the arm at the end of a path: two sections, and the shares.

    Args:
        setup: robot and sensors.
        stamps: [s] ascending.
        postures: (n_q,) at these times.
        volume: of the same path.
        title: above the figure.
        nearest_W: (3,) [m] the scene's point that is truly closest; marked.
    """
    memory_s = setup.scenario.controller.memory.memory_s
    tool_W = np.asarray(setup.robot.tool_pose(postures[-1]))[:3, 3]
    figure = new_figure(12.0, 4.6, title)
    axes = figure.subplots(1, 3, width_ratios=(1.25, 1.25, 1.0))
    level = float(tool_W[2] if nearest_W is None else nearest_W[2])
    bearing = float(np.arctan2(*(tool_W if nearest_W is None else nearest_W)[1::-1]))
    along = np.array([np.cos(bearing), np.sin(bearing), 0.0])
    sections = (
        (np.eye(3)[0], np.eye(3)[1], np.array([0.0, 0.0, level]), "x [m]", "y [m]",
         f"(a) level, z = {level:.2f} m"),
        (along, np.eye(3)[2], np.zeros(3), "along the bearing [m]", "z [m]",
         f"(b) upright, bearing {np.rad2deg(bearing):.0f} deg"),
    )  # fmt: skip
    for ax, (right, up, origin, right_name, up_name, name) in zip(axes[:2], sections, strict=True):
        _section(ax, setup, stamps, postures, (right, up, origin), memory_s)
        if nearest_W is not None:
            at = nearest_W - origin
            ax.plot(at @ right, at @ up, marker="x", color="black", markersize=7, mew=1.8)
        ax.set(xlabel=right_name, ylabel=up_name)
        ax.set_title(name, loc="left", fontsize=10)
    _shares(axes[2], volume, memory_s)
    names = ("in view", f"seen within {memory_s:g} s", "seen before", "never seen")
    handles = [Patch(color=c, label=n) for c, n in zip(_COLOURS, names, strict=True)]
    handles.append(Patch(color=_ARM, label="arm"))
    if nearest_W is not None:
        handles.append(
            axes[0].plot([], [], "x", color="black", mew=1.8, label="closest point of the scene")[0]
        )
    legend_below(figure, handles)
    tidy_axes(*axes)
    for ax in axes[:2]:
        ax.locator_params(axis="x", nbins=6)
    return figure


def _section(
    ax: Axes,
    setup: Setup,
    stamps: Sequence[float],
    postures: Sequence[Array],
    plane: tuple[Array, Array, Array],
    memory_s: float,
) -> None:
    """One plane through the space round the arm: right, up and origin in world."""
    right, up, origin = plane
    robot, q = setup.robot, postures[-1]
    shadows = []
    for name, T_WL in zip(robot.link_names, np.asarray(robot.link_poses(q)), strict=True):
        vertices_L, triangles = robot.mesh(name)
        apart = placed(T_WL, vertices_L) - origin
        shadows.append(np.column_stack([apart @ right, apart @ up])[triangles])
    shadow = np.concatenate(shadows)  # (f, 3, 2)
    low = shadow.reshape(-1, 2).min(axis=0) - REACH_M
    high = shadow.reshape(-1, 2).max(axis=0) + REACH_M
    u, v = (np.arange(a, b, _STEP_M) for a, b in zip(low, high, strict=True))
    grid = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    points_W = origin + grid[:, :1] * right + grid[:, 1:] * up
    near = distances(robot, q, points_W) <= REACH_M
    kind = np.full(len(grid), np.nan)
    ages = stamps[-1] - last_seen(setup, points_W[near], stamps, postures)
    kind[near] = np.select([ages <= 1e-9, ages <= memory_s, np.isfinite(ages)], [0, 1, 2], 3)
    ax.imshow(
        kind.reshape(len(v), len(u)), origin="lower", interpolation="nearest",
        extent=(low[0], low[0] + _STEP_M * len(u), low[1], low[1] + _STEP_M * len(v)),
        cmap=ListedColormap(_COLOURS), norm=BoundaryNorm((-0.5, 0.5, 1.5, 2.5, 3.5), 4),
    )  # fmt: skip
    ax.add_collection(PolyCollection(list(shadow), facecolors=_ARM, edgecolors="none"))


def _shares(ax: Axes, volume: BlindVolume, memory_s: float) -> None:
    """The share of the volume that was not seen for so long."""
    times = np.linspace(0.0, max(2.0 * memory_s, 1.0), 81)
    shares = [100.0 * volume.share_unseen_for(time) for time in times]
    ax.step(times, shares, where="post", color="#0072B2", linewidth=1.6)
    ax.axvline(memory_s, color=GREY, linewidth=1.0, linestyle=DOTTED)
    ax.annotate(
        "memory", (memory_s, 97.0), xytext=(4, 0), textcoords="offset points", va="top", fontsize=9,
        color=GREY,
    )  # fmt: skip
    ax.set(
        ylim=(0.0, 100.0),
        xlim=(0.0, float(times[-1])),
        xlabel="not seen for more than [s]",
        ylabel=f"share of the volume within {REACH_M:g} m [%]",
    )
    ax.set_title("(c)", loc="left", fontsize=10)

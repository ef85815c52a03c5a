"""The robot at several resolutions in what it senses, in the form of the paper's Fig. 6."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from proxcgal import _core
from proxcgal.core.typing import Array
from proxcgal.study.pair_figure import (
    PAIR_COLOUR,
    caption_3d,
    draw_pair_arrow,
    frame_3d,
    surface_points,
)
from proxcgal.study.plotting import LEGEND, new_figure
from proxcgal.study.timing.inputs import Inputs

RAW_COLOUR, NEAR_COLOUR, ROBOT_COLOUR = "#3A7BDB", "#17803D", "#404040"


def cloud_figure(
    grid: Sequence[Inputs], near_W: Array, *, bearing: float = np.deg2rad(-62.0)
) -> Figure:
    """The robot at several resolutions, what was sensed, and the closest pair: [WA] Fig. 6.

    Where the paper has a photograph, (a) is all that was sensed, the whole room. The other panels
    are near the robot: its meshes' vertices, one resolution each; the sensed points there, which
    are on the robot itself; the filtered ones; an arrow between the closest pair.

    Args:
        grid: one robot on one posture and the whole cloud, resolution by resolution.
        near_W: the filtered cloud near the robot, (n, 3) [m].
        bearing: from where it is looked at, counter-clockwise from x, seen from above [rad].
    """
    rows = 1 + len(grid) // 2
    height = 3.5 * rows + 0.9
    title = f"{grid[0].robot.name}: clouds and closest pair"
    figure = new_figure(7.4, height, title, layout=None, y=1.0 - 0.12 / height)
    figure.subplots_adjust(
        left=0.0, right=0.96, bottom=0.5 / height, top=1.0 - 0.75 / height, wspace=0.02, hspace=0.14
    )
    finest = _vertices(grid[-1])
    ax = figure.add_subplot(rows, 2, 1, projection="3d")
    _draw_points(ax, grid[-1].points_W, finest, near_W, sizes=(3.0, 0.06, 3.0))
    frame_3d(ax, np.concatenate([grid[-1].points_W, finest]), bearing)
    caption_3d(ax, 1.04, f"(a) all {len(grid[-1].points_W)} points sensed")
    everything_W = np.concatenate([finest, near_W])
    low, high = everything_W.min(axis=0), everything_W.max(axis=0)
    for place, inputs in enumerate(grid, 1):
        ax = figure.add_subplot(rows, 2, place + 1, projection="3d")
        pair = _core.closest_pair(inputs.robot, inputs.q, near_W)
        beside = ((inputs.points_W >= low) & (inputs.points_W <= high)).all(axis=1)
        robot_W = _vertices(inputs)
        # A coarse tube has vertices at its ends only: its surface tells where it is.
        faint = {"s": 0.8, "linewidths": 0, "depthshade": False, "color": "#D4D4D4"}
        ax.scatter(*surface_points(inputs.robot, inputs.q).T, zorder=0, **faint)
        size = float(np.clip(8000.0 / len(robot_W), 0.15, 6.0))
        _draw_points(ax, inputs.points_W[beside], robot_W, near_W, sizes=(7.0, size, 7.0))
        draw_pair_arrow(ax, np.asarray(pair.obstacle_W), np.asarray(pair.surface_W))
        frame_3d(ax, everything_W, bearing)
        caption_3d(ax, 1.04, f"({'abcdefgh'[place]}) {inputs.vertices} vertices a link")
        text = f"{pair.link}, {1000 * pair.distance:.1f} mm"
        caption_3d(ax, 0.98, text, fontsize=9, color=PAIR_COLOUR)
    dots: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 5}
    handles = [
        Line2D([], [], color=ROBOT_COLOUR, label="vertices of the robot", **dots),
        Line2D([], [], color=RAW_COLOUR, label="sensed", **dots),
        Line2D([], [], color=NEAR_COLOUR, label="filtered, within 1 m", **dots),
        Line2D([], [], color=PAIR_COLOUR, linewidth=2.0, label="closest pair"),
    ]
    figure.legend(handles=handles, loc="lower center", ncols=4, **LEGEND)
    return figure


def _draw_points(
    ax: Any, sensed_W: Array, robot_W: Array, near_W: Array, sizes: Sequence[float]
) -> None:
    ax.computed_zorder = False  # the arrow belongs on top, whatever lies before it
    plain: dict[str, Any] = {"linewidths": 0, "depthshade": False}
    clouds = (
        (robot_W, ROBOT_COLOUR, sizes[1]),
        (sensed_W, RAW_COLOUR, sizes[0]),
        (near_W, NEAR_COLOUR, sizes[2]),
    )
    for zorder, (cloud_W, colour, size) in enumerate(clouds, 1):
        ax.scatter(*cloud_W.T, s=size, color=colour, zorder=zorder, **plain)


def _vertices(inputs: Inputs) -> Array:
    """All vertices of the robot's meshes, in world, (n, 3) [m]."""
    poses_W = np.asarray(inputs.robot.link_poses(inputs.q))
    names = inputs.robot.link_names
    return np.concatenate([
        np.asarray(inputs.robot.mesh(name)[0]) @ T_WL[:3, :3].T + T_WL[:3, 3]
        for name, T_WL in zip(names, poses_W, strict=True)
    ])  # fmt: skip

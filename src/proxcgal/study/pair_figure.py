"""Both controllers' closest pairs on the same posture, in the form of the paper's Fig. 3."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from proxcgal import _core
from proxcgal.core.typing import Array
from proxcgal.models.robots import Robot
from proxcgal.study.plotting import new_figure

PAIR_COLOUR = "#C80000"
ROBOT_SPACING = 0.018  # [m] about, between the points that stand for the arm


@dataclass(frozen=True, slots=True, kw_only=True)
class PairView:
    """One controller's closest pair on one posture, as Fig. 3 shows it."""

    title: str
    robot_W: Array  # (n, 3) [m] points of its meshes, or sensor mounting points
    context_W: Array  # (m, 3) [m] the rest of the arm, drawn faintly; may be empty
    obstacle_W: Array  # (k, 3) [m]
    control_W: Array  # (3,) [m] point of the robot
    nearest_W: Array  # (3,) [m] point of the obstacle
    link: str

    @property
    def distance(self) -> float:
        """Length of the pair [m]."""
        return float(np.linalg.norm(self.control_W - self.nearest_W))


def pair_figure(
    rows: Sequence[Sequence[PairView]], *, title: str, bearing: float = np.deg2rad(-62.0)
) -> Figure:
    """Closest pairs side by side, a row a scene: the form of [WA] Fig. 3.

    The robot (or its sensors) as points, the obstacle in blue, a red arrow from the obstacle's
    point to the control point.

    Args:
        rows: scene by scene, the controllers' views.
        title: above the figure.
        bearing: from where it is looked at, counter-clockwise from x, seen from above [rad].
    """
    columns, height = len(rows[0]), 3.9 * len(rows) + 0.3
    figure = new_figure(3.8 * columns, height, title, layout=None, y=1.0 - 0.1 / height)
    figure.subplots_adjust(
        left=0.0, right=0.96, bottom=0.25 / height, top=1.0 - 0.8 / height, wspace=0.04, hspace=0.16
    )
    for i, row in enumerate(rows):
        everything = np.vstack([np.vstack((v.robot_W, v.context_W, v.obstacle_W)) for v in row])
        for j, view in enumerate(row):
            ax = figure.add_subplot(len(rows), columns, i * columns + j + 1, projection="3d")
            _draw_pair(ax, view, everything, bearing)
            letter = "abcdefgh"[i * columns + j]
            text = f"{view.link}, {1000 * view.distance:.0f} mm"
            caption_3d(ax, 1.05, f"({letter}) {view.title}")
            caption_3d(ax, 0.99, text, fontsize=9, color=PAIR_COLOUR)
    return figure


def _draw_pair(ax: Any, view: PairView, everything: Array, bearing: float) -> None:
    frame_3d(ax, everything, bearing)
    ax.computed_zorder = False  # the arrow belongs on top, whatever lies before it
    plain: dict[str, Any] = {"linewidths": 0, "depthshade": False}
    ax.scatter(*view.obstacle_W.T, s=2.0, color="#5B93E6", zorder=1, **plain)
    if len(view.context_W):
        ax.scatter(*view.context_W.T, s=0.8, color="#D4D4D4", zorder=2, **plain)
    size, colour, alpha = (1.6, "#606060", 0.6) if len(view.robot_W) > 200 else (14, "black", 1.0)
    ax.scatter(*view.robot_W.T, s=size, color=colour, alpha=alpha, zorder=3, **plain)
    draw_pair_arrow(ax, view.nearest_W, view.control_W)


def draw_pair_arrow(ax: Any, obstacle_W: Array, surface_W: Array) -> None:
    """The closest pair as an arrow from the obstacle's point to the robot's, (3,) each [m]."""
    apart_W = surface_W - obstacle_W
    ax.quiver(
        *obstacle_W, *apart_W, color=PAIR_COLOUR, linewidth=2.0, zorder=5,
        arrow_length_ratio=min(0.5, 0.06 / max(float(np.linalg.norm(apart_W)), 1e-9)),
    )  # fmt: skip


def frame_3d(ax: Any, everything_W: Array, bearing: float) -> None:
    """Axes to scale round all points, (n, 3) [m], seen from a bearing [rad]; units on each."""
    low, high = everything_W.min(axis=0), everything_W.max(axis=0)
    ax.set_proj_type("ortho")
    ax.view_init(elev=20.0, azim=np.rad2deg(bearing))
    ax.set_box_aspect(high - low, zoom=0.98)
    for setter, a, b in zip((ax.set_xlim, ax.set_ylim, ax.set_zlim), low, high, strict=True):
        setter(a, b)
    for name in "xyz":
        getattr(ax, f"set_{name}label")(f"{name} [m]", fontsize=8, labelpad=-4)
    ax.tick_params(labelsize=7, pad=-2)
    ax.locator_params(nbins=4)
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        axis._axinfo["grid"].update(color="#E4E4E4", linewidth=0.5)


def caption_3d(ax: Any, height: float, text: str, **style: Any) -> None:
    """A line of text above a panel, at that share of its height."""
    ax.text2D(0.5, height, text, transform=ax.transAxes, ha="center", **{"fontsize": 10} | style)


def whole_body_view(
    robot: Robot, q: Array, points_W: Array, *, drawn_W: Array, title: str
) -> PairView:
    """The pair that the whole-body controller acts on: Algorithm 2 on the control meshes.

    Args:
        robot: points on its control meshes stand for it in the picture.
        q: posture, (n_q,) [rad].
        points_W: the obstacle, (n, 3) [m].
        drawn_W: what of it is drawn, (m, 3) [m].
        title: above the view.

    Raises:
        GeometryError: no point.
    """
    pair = _core.closest_pair(robot, q, points_W)
    return PairView(
        title=title,
        robot_W=surface_points(robot, q),
        context_W=np.zeros((0, 3)),
        obstacle_W=drawn_W,
        control_W=np.array(pair.surface_W),
        nearest_W=np.array(pair.obstacle_W),
        link=pair.link,
    )


def sensor_view(
    robot: Robot, skin: _core.Skin, q: Array, points_W: Array, *, drawn_W: Array, title: str
) -> PairView:
    """The pair that the baseline acts on: the sensor's mounting point nearest to any point.

    Args: as `whole_body_view`, and `skin` for the mounting points.
    """
    poses = dict(zip(robot.link_names, np.asarray(robot.link_poses(q)), strict=True))
    mounts_W = np.array([(poses[m.link] @ np.asarray(m.T_LS))[:3, 3] for m in skin.mounts])
    squared = ((points_W[:, None, :] - mounts_W[None, :, :]) ** 2).sum(axis=2)
    point, mount = np.unravel_index(int(squared.argmin()), squared.shape)
    return PairView(
        title=title,
        robot_W=mounts_W,
        context_W=surface_points(robot, q),
        obstacle_W=drawn_W,
        control_W=mounts_W[mount],
        nearest_W=np.array(points_W[point]),
        link=skin.mounts[mount].link,
    )


def surface_points(robot: Robot, q: Array, spacing: float = ROBOT_SPACING) -> Array:
    """Points spread evenly over all control meshes, in world, (n, 3) [m].

    Not their vertices: a decimated tube has those at its ends only.

    Args:
        robot: whose meshes.
        q: posture, (n_q,) [rad].
        spacing: about as far from one another [m].
    """
    generator = np.random.default_rng(0)  # the same picture each time
    parts = []
    for name, T_WL in zip(robot.link_names, np.asarray(robot.link_poses(q)), strict=True):
        vertices_L, triangles = (np.asarray(part) for part in robot.mesh(name))
        a, b, c = (vertices_L[triangles[:, corner]] for corner in range(3))
        area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
        count = max(1, round(float(area.sum()) / spacing**2))
        at = generator.choice(len(area), count, p=area / area.sum())
        u, v = generator.random((2, count, 1))
        folded = u + v > 1.0
        u, v = np.where(folded, 1.0 - u, u), np.where(folded, 1.0 - v, v)
        points_L = a[at] + u * (b - a)[at] + v * (c - a)[at]
        parts.append(points_L @ T_WL[:3, :3].T + T_WL[:3, 3])
    return np.vstack(parts)

"""Pictures of a robot's links and of a posture, drawn from samples of the surfaces.

Needs neither a display nor OpenGL, and takes meshes of any size.
"""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from proxcgal.core.transforms import placed
from proxcgal.core.typing import Array, Ints
from proxcgal.models.description import RobotDescription
from proxcgal.models.formats.parts import motion
from proxcgal.models.mesh.triangles import sample, unit_normals
from proxcgal.study.plotting import new_figure

_PIXELS = 260
_COLUMNS = 4
_POINTS = 150_000  # of one picture
_BACKGROUND = 1.0
# Views of the posture: what points out of the picture, and what points up.
_VIEWS = {"front, from +x": (0.0, 0.0), "side, from -y": (-90.0, 0.0), "from above": (0.0, 89.9)}
_OBLIQUE = (-55.0, 25.0)  # turn about z and height [deg]


def robot_figure(description: RobotDescription) -> Figure:
    """A picture of every link with its size, and of the posture in the middle of the limits."""
    links = description.links
    rows = -(-(len(links) + len(_VIEWS) + 1) // _COLUMNS)
    figure = new_figure(3 * _COLUMNS, 3.1 * rows, description.name)
    axes = figure.subplots(rows, _COLUMNS, squeeze=False).ravel()
    for ax in axes:
        ax.axis("off")
    whole = posture(description)
    views = {"posture, oblique": _OBLIQUE, **_VIEWS}
    for ax, (title, view) in zip(axes, views.items(), strict=False):
        _show(ax, title, *picture(whole, view))
    for ax, link in zip(axes[len(views) :], links, strict=False):
        size = " x ".join(f"{s:.3g}" for s in np.ptp(link.vertices_L, axis=0))
        mesh = {link.name: (link.vertices_L, link.triangles)}
        _show(ax, f"{link.name}\n{size} m", *picture(mesh, _OBLIQUE))
    return figure


def middle(description: RobotDescription) -> list[float]:
    """Joint positions in the middle of the limits, 0 where a joint has none."""
    return [
        float((j.q_min + j.q_max) / 2) if np.isfinite([j.q_min, j.q_max]).all() else 0.0
        for j in description.joints
    ]


def posture(description: RobotDescription) -> dict[str, tuple[Array, Ints]]:
    """Each link's mesh in the world, in the middle of the limits."""
    poses: list[Array] = []
    for joint, q in zip(description.joints, middle(description), strict=True):
        before = poses[joint.parent] if joint.parent >= 0 else np.eye(4)
        poses.append(before @ joint.origin @ motion(joint.type, joint.axis, q))
    return {
        link.name: (
            placed((poses[link.joint] if link.joint >= 0 else np.eye(4)) @ link.T_JL,
                   link.vertices_L),
            link.triangles,
        )
        for link in description.links
    }  # fmt: skip


def picture(
    meshes: Mapping[str, tuple[Array, Ints]], view: tuple[float, float]
) -> tuple[Array, float]:
    """Grey values (n, n), row 0 on top, and the width shown [m]; a depth buffer of samples."""
    turn, height = np.radians(view)
    out = np.array([np.cos(turn) * np.cos(height), np.sin(turn) * np.cos(height), np.sin(height)])
    right = np.array([-np.sin(turn), np.cos(turn), 0.0])
    R = np.stack([right, np.cross(out, right), out])
    flat = {name: (v @ R.T, f) for name, (v, f) in meshes.items()}
    corners = np.concatenate([v for v, _ in flat.values()])
    low, high = corners.min(axis=0), corners.max(axis=0)
    width = 1.08 * float(max(high[0] - low[0], high[1] - low[1], 1e-9))
    image = np.full(_PIXELS * _PIXELS, _BACKGROUND)
    depth = np.full(_PIXELS * _PIXELS, -np.inf)
    for v, f in flat.values():
        normals, areas = unit_normals(v, f)
        spacing = max(width / _PIXELS / 1.6, float(np.sqrt(areas.sum() / _POINTS)))
        points, owner = sample(v, f, spacing)
        column, row = (
            np.clip(((points[:, k] - (low[k] + high[k]) / 2) / width + 0.5) * _PIXELS, 0,
                    _PIXELS - 1).astype(int) for k in (0, 1)
        )  # fmt: skip
        pixel = (_PIXELS - 1 - row) * _PIXELS + column
        order = np.argsort(points[:, 2])  # the nearest is written last
        pixel, owner, near = pixel[order], owner[order], points[order, 2]
        seen = np.zeros(_PIXELS * _PIXELS, dtype=np.int64)
        seen[pixel] = np.arange(1, len(pixel) + 1)
        hit = np.flatnonzero(seen)
        index = seen[hit] - 1
        closer = near[index] > depth[hit]
        hit, index = hit[closer], index[closer]
        depth[hit] = near[index]
        image[hit] = 0.15 + 0.7 * np.abs(normals[owner[index], 2])
    return image.reshape(_PIXELS, _PIXELS), width


def _show(ax: Axes, title: str, image: Array, width: float) -> None:
    ax.imshow(image, cmap="gray", vmin=0, vmax=1, extent=(0, width, 0, width))
    ax.set_title(f"{title}\n(width {width:.3g} m)", fontsize=8)

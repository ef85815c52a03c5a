"""The space round the arm that no sensor sees, and for how long none has."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from proxcgal import _core
from proxcgal.core.errors import ConfigError
from proxcgal.core.transforms import inverse, placed
from proxcgal.core.typing import Array
from proxcgal.evaluation.visibility import Visibility
from proxcgal.models.robots import Robot
from proxcgal.scenario.setup import Setup

REACH_M = 0.5  #: [m] from the arm's surface: what is farther is not counted
_SPACING_M = 0.05  # [m] of the points that stand for the volume


@dataclass(frozen=True, slots=True)
class BlindVolume:
    """Points within reach of the arm, and how long ago each was in view."""

    points_W: Array  #: (n, 3) [m], evenly in space
    ages: Array  #: (n,) [s] since the last scan that had it in view, inf: none on the path

    def share_unseen_for(self, seconds: float) -> float:
        """Of the volume within reach: what was in no scan's view for that long, up to the end."""
        return float((self.ages > seconds).mean()) if len(self.ages) else 0.0


def volume_within(robot: Robot, q: Array, reach: float = REACH_M) -> Array:
    """(n, 3) points outside the arm and at most `reach` from its surface [m].

    Args:
        robot: its control meshes are asked.
        q: (n_q,) posture.
        reach: [m]
    """
    links = zip(robot.link_names, np.asarray(robot.link_poses(q)), strict=True)
    clouds = [placed(T_WL, robot.mesh(name)[0]) for name, T_WL in links]
    low = np.min([cloud.min(axis=0) for cloud in clouds], axis=0) - reach
    high = np.max([cloud.max(axis=0) for cloud in clouds], axis=0) + reach
    axes = [np.arange(a, b, _SPACING_M) for a, b in zip(low, high, strict=True)]
    points_W = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    distance = distances(robot, q, points_W)
    near_W = points_W[(distance > 0.0) & (distance <= reach)]
    return near_W[_core.signed_distance(robot, q, near_W).distance > 0.0]


def distances(robot: Robot, q: Array, points_W: Array) -> Array:
    """(n,) [m] from points to the arm's surface, any link; unsigned."""
    nearest = np.full(len(points_W), np.inf)
    for name, T_WL in zip(robot.link_names, np.asarray(robot.link_poses(q)), strict=True):
        tree = _core.MeshTree(*robot.mesh(name))
        points_L = np.ascontiguousarray(placed(inverse(T_WL), points_W))
        np.minimum(nearest, tree.closest(points_L)[0], out=nearest)
    return nearest


def last_seen(
    setup: Setup, points_W: Array, stamps: Sequence[float], postures: Sequence[Array]
) -> Array:
    """(n,) [s] stamp of the last posture that had each point in view, -inf where none had.

    Only the robot itself hides points; occlusion by the scene is ignored.

    Args:
        setup: robot and sensors.
        points_W: (n, 3) [m].
        stamps: [s] ascending.
        postures: (n_q,) at these times.
    """
    if len(stamps) != len(postures) or not len(stamps):
        raise ConfigError(
            f"coverage: {len(stamps)} stamps and {len(postures)} postures: as many of one as of "
            "the other, and at least one"
        )
    visibility = Visibility(setup, None)
    seen = np.full(len(points_W), -np.inf)
    for stamp, posture in sorted(
        zip(stamps, postures, strict=True), key=lambda pair: pair[0], reverse=True
    ):
        rows = np.flatnonzero(np.isinf(seen))
        if not len(rows):
            break
        seen[rows[visibility.see(posture, points_W[rows])]] = stamp
    return seen


def blind_volume(setup: Setup, stamps: Sequence[float], postures: Sequence[Array]) -> BlindVolume:
    """Of the volume within reach at the end of a path, or at one posture, what was in view when.

    Args:
        setup: robot and sensors.
        stamps: [s] ascending, the last is now.
        postures: (n_q,) at these times; one alone is a posture.
    """
    points_W = volume_within(setup.robot, postures[-1])
    return BlindVolume(points_W, stamps[-1] - last_seen(setup, points_W, stamps, postures))

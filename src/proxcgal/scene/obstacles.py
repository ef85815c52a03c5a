"""What stands and moves beside the robot: solids, where they are, and how fast."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from proxcgal.core.transforms import placed
from proxcgal.core.typing import Array
from proxcgal.scene.obstacle_keys import Obstacle
from proxcgal.scene.solids import Solid


class Scene(Protocol):
    """Rigid solids on known ways. Time is that of the simulated world, 0 at the start [s]."""

    @property
    def names(self) -> tuple[str, ...]:
        """For messages and pictures, one each."""

    @property
    def solids(self) -> tuple[Solid, ...]:
        """Their shapes."""

    @property
    def still(self) -> bool:
        """Does nothing ever move?"""

    def poses(self, time: float) -> Array:
        """(n, 4, 4) T_WO."""

    def twists(self, time: float) -> Array:
        """(n, 6) in world: velocity of each origin [m/s], angular velocity [rad/s]."""


class ObstacleScene:
    """The `[[obstacle]]` tables of a scenario."""

    def __init__(self, obstacles: Sequence[Obstacle]) -> None:
        """Args: `obstacles` in the base frame."""
        self.names = tuple(obstacle.name for obstacle in obstacles)
        self.solids = tuple(obstacle.solid() for obstacle in obstacles)
        self.still = not any(obstacle.path for obstacle in obstacles)
        self._poses = np.array([obstacle.pose() for obstacle in obstacles]).reshape(-1, 4, 4)
        self._paths = [
            (row, np.array(obstacle.path))
            for row, obstacle in enumerate(obstacles)
            if obstacle.path
        ]

    def poses(self, time: float) -> Array:
        """(n, 4, 4) T_WO: linear between the points of a path, at rest before and after."""
        poses = self._poses.copy()
        for row, path in self._paths:
            for axis in range(3):
                poses[row, axis, 3] = np.interp(time, path[:, 0], path[:, 1 + axis])
        return poses

    def twists(self, time: float) -> Array:
        """(n, 6): of the path's piece that begins at or before that time."""
        twists = np.zeros((len(self.solids), 6))
        for row, path in self._paths:
            piece = int(np.searchsorted(path[:, 0], time, side="right")) - 1
            if 0 <= piece < len(path) - 1:
                step = path[piece + 1] - path[piece]
                twists[row, :3] = step[1:] / step[0]
        return twists


class Together:
    """Several scenes as one."""

    def __init__(self, *scenes: Scene) -> None:
        """Args: `scenes`, whose solids follow one another."""
        self._scenes = [scene for scene in scenes if scene.solids]
        self.names = tuple(name for scene in self._scenes for name in scene.names)
        self.solids = tuple(solid for scene in self._scenes for solid in scene.solids)
        self.still = all(scene.still for scene in self._scenes)

    def poses(self, time: float) -> Array:
        """(n, 4, 4) T_WO."""
        return np.concatenate([np.empty((0, 4, 4)), *(each.poses(time) for each in self._scenes)])

    def twists(self, time: float) -> Array:
        """(n, 6) in world: velocity of each origin [m/s], angular velocity [rad/s]."""
        return np.concatenate([np.empty((0, 6)), *(each.twists(time) for each in self._scenes)])


class KnownCloud:
    """Points of a scene's own surfaces, which ride on its solids."""

    def __init__(self, scene: Scene, spacing: float) -> None:
        """Args: `spacing` between neighbours, at most [m]."""
        self._scene = scene
        self._points_O = [solid.points(spacing) for solid in scene.solids]
        self._still_W = self._placed(0.0) if scene.still else None

    def __len__(self) -> int:
        """How many points."""
        return sum(map(len, self._points_O))

    @property
    def still(self) -> bool:
        """Do they never move?"""
        return self._still_W is not None

    def __call__(self, time: float) -> Array:
        """(n, 3) in world [m]."""
        return self._placed(time) if self._still_W is None else self._still_W

    def velocities(self, time: float) -> Array:
        """(n, 3) of the same points in world [m/s]."""
        poses, twists = self._scene.poses(time), self._scene.twists(time)
        parts = [
            twist[:3] + np.cross(twist[3:], points_O @ T_WO[:3, :3].T)
            for points_O, T_WO, twist in zip(self._points_O, poses, twists, strict=True)
        ]
        return np.concatenate([np.empty((0, 3)), *parts])

    def _placed(self, time: float) -> Array:
        parts = [
            placed(T_WO, points_O)
            for T_WO, points_O in zip(self._scene.poses(time), self._points_O, strict=True)
        ]
        return np.concatenate([*parts, np.empty((0, 3))])


@dataclass(frozen=True, slots=True, eq=False)
class FixedCloud:
    """Known points that stand still, such as a recording holds."""

    points_W: Array  #: (n, 3) [m]
    still: ClassVar[bool] = True

    def __len__(self) -> int:
        """How many points."""
        return len(self.points_W)

    def __call__(self, time: float) -> Array:
        """(n, 3) in world [m]."""
        return self.points_W

    def velocities(self, time: float) -> Array:
        """(n, 3) zeros [m/s]."""
        return np.zeros_like(self.points_W)


Cloud = KnownCloud | FixedCloud

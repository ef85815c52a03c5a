"""Which points of space the sensors have in view, whatever they measure there."""

import numpy as np

from proxcgal.core.typing import Array, Bools
from proxcgal.scenario.setup import Setup
from proxcgal.scene.obstacles import Scene
from proxcgal.sim.faults import RealMounts
from proxcgal.sim.world import World

_BEFORE_M = 0.005  # a ray that ends so little before a point on a surface has reached it


class Visibility:
    """The fields of view of all sensors, as far as robot and scene leave them free.

    A point is in view where a straight line from some sensor reaches it, inside the field of view
    and the workspace. A zone measures along its middle ray only: what is small may lie between two.
    """

    def __init__(self, setup: Setup, scene: Scene | None) -> None:
        """Args: without a `scene` only the robot itself hides anything."""
        self._world = World(setup.robot, scene)
        self._mounts = RealMounts(setup.robot, setup.skin.mounts)
        sensor = setup.scenario.skin.sensor
        self._tangent = np.tan(0.5 * sensor.field_of_view)
        self._near, self._far, self._reach = sensor.min_range, sensor.max_range, sensor.workspace
        self._mounting = setup.scenario.simulation.mounting

    def see(self, q: Array, points_W: Array, time: float = 0.0) -> Bools:
        """(n,) true where any sensor has the point (n, 3) in view at a posture.

        Args:
            q: (n_q,) posture.
            points_W: (n, 3) [m].
            time: [s] at which the scene is where it is.
        """
        self._world.place(q, time)
        seen = np.zeros(len(points_W), bool)
        for T in self._mounts.poses_W(q, time):
            apart = points_W - T[:3, 3]
            x, y, z = (apart @ T[:3, :3]).T
            distance = np.linalg.norm(apart, axis=1)
            wide = self._tangent * z
            inside = (z > self._near) & (z <= self._far) & (distance <= self._reach)
            inside &= (np.abs(x) <= wide) & (np.abs(y) <= wide) & ~seen
            rows = np.flatnonzero(inside)
            if not len(rows):
                continue
            directions = apart[rows] / distance[rows, None]
            length = self._world.cast(T[None, :3, 3], directions[None], self._mounting).length[0]
            seen[rows] = length >= distance[rows] - _BEFORE_M
        return seen

"""What sensors must see of the arm itself: their rays against its full-resolution links."""

import numpy as np
from numpy.typing import NDArray

from proxcgal import _core
from proxcgal.core.transforms import rotation_from_vector
from proxcgal.core.typing import Array
from proxcgal.models.robots import Robot, once_per_robot

_MOUNTING = 0.005  # [m] of each ray, as `filter.min_hit`


class Body:
    """The links' full surfaces at one posture."""

    def __init__(self, robot: Robot, poses_W: Array) -> None:
        """Args: `poses_W` (n_links, 4, 4) T_WL."""
        self.poses_W = poses_W
        self._trees = _trees(robot)
        boxes = [
            (np.asarray(t.vertices_L).min(0), np.asarray(t.vertices_L).max(0)) for t in self._trees
        ]
        self._centres = np.array([(low + high) / 2 for low, high in boxes])
        self._radii = np.array([np.linalg.norm(high - low) / 2 for low, high in boxes])

    def cast(self, origins_W: Array, rays_W: Array) -> Array:
        """(n,) length to the first surface, past the sensor's own mounting; inf for none."""
        length = np.full(len(origins_W), np.inf)
        start = origins_W + _MOUNTING * rays_W
        for tree, T_WL, centre, radius in zip(
            self._trees, self.poses_W, self._centres, self._radii, strict=True
        ):
            to_centre = T_WL[:3, :3] @ centre + T_WL[:3, 3] - start
            along = np.einsum("ij,ij->i", to_centre, rays_W)
            off = np.einsum("ij,ij->i", to_centre, to_centre) - np.maximum(along, 0.0) ** 2
            near = np.flatnonzero(off <= radius**2)
            if near.size:
                origins_L = (start[near] - T_WL[:3, 3]) @ T_WL[:3, :3]
                hit = np.asarray(tree.first_hit(origins_L, rays_W[near] @ T_WL[:3, :3]))
                length[near] = np.minimum(length[near], hit)
        return length + _MOUNTING


@once_per_robot
def _trees(robot: Robot) -> list[_core.MeshTree]:
    """Full surfaces, kept as long as the robot lives."""
    return [_core.MeshTree(*robot.full_mesh(name)) for name in robot.link_names]


class View:
    """What one sensor must see from a mount moved by a little, as ranges along its z."""

    def __init__(self, body: Body, model: _core.SensorModel, T_WS: Array) -> None:
        """Args: `T_WS` (4, 4) where the sensor must be."""
        self._body = body
        rays = np.asarray(_core.zone_directions(model))
        length = np.linalg.norm(rays, axis=1)
        self._rays_S = rays / length[:, None]
        self._z_per_length = 1.0 / length
        self._T_WS = T_WS

    def __call__(self, moved: Array, zones: NDArray[np.intp]) -> Array:
        """Ranges (k, len(zones)) from mounts moved by (k, 6): shift [m], turn [rad], in S."""
        turns = np.array([rotation_from_vector(turn) for turn in moved[:, 3:]])
        R_WS = self._T_WS[:3, :3] @ turns
        origins = self._T_WS[:3, 3] + moved[:, :3] @ self._T_WS[:3, :3].T
        rays = self._rays_S[zones] @ np.swapaxes(R_WS, 1, 2)
        starts = np.broadcast_to(origins[:, None, :], rays.shape)
        lengths = self._body.cast(starts.reshape(-1, 3), rays.reshape(-1, 3))
        return np.asarray(lengths.reshape(len(moved), len(zones)) * self._z_per_length[zones])

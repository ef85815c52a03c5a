"""True distances: exact surfaces against exact surfaces, known to the simulator alone.

For the evaluation only; no controller ever sees them. What is skipped is skipped by a bound that
proves it: between two postures a distance shrinks by no more than the two surfaces moved.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from proxcgal import _core
from proxcgal.sim import boxes
from proxcgal.sim.surfaces import Surfaces, inverse

if TYPE_CHECKING:
    from proxcgal.models.robots import Robot
    from proxcgal.sim.scenario_keys import Obstacle

Array = NDArray[np.float64]

#: Looked for beyond the least distance so far, so that a far pair is not asked at every tick [m].
AHEAD_M = 0.05


class Truth:
    """How near one robot comes to the scene and to itself, tick after tick."""

    def __init__(self, robot: Robot, obstacles: Sequence[Obstacle]) -> None:
        """Builds the scene's surfaces; the robot's are kept from trial to trial."""
        self._robot = robot
        self._surfaces = Surfaces.of(robot)
        self._scene = _SceneDistance(self._surfaces, obstacles)
        self._own = _OwnDistance(self._surfaces)

    def __call__(self, q: Array) -> tuple[float, str, float]:
        """Distance to the scene, its link, distance between the robot's own links.

        Distances in metres, inf where there is nothing. The links that count against the scene are
        those that some joint moves. The robot's own distance is asked anew whenever it could have
        become the least of the run, no farther than 0.05 m beyond that, and is the last one asked
        otherwise: its minimum over the run is exact.
        """
        poses_W = np.asarray(self._robot.link_poses(q))
        distance, link = self._scene.at(poses_W)
        name = self._robot.link_names[link] if link >= 0 else ""
        return distance, name, self._own.at(poses_W)


class _SceneDistance:
    """Least distance from moving links to boxes that stand still, exact at every call."""

    def __init__(self, surfaces: Surfaces, obstacles: Sequence[Obstacle]) -> None:
        self._surfaces = surfaces
        # A box in its own frame: there its faces are their own bounding boxes.
        self._trees = [_core.MeshTree(*boxes.surface(box.size, np.eye(4))) for box in obstacles]
        self._T_OW = [inverse(box.pose()) for box in obstacles]
        rows = [(link, box) for box in range(len(obstacles)) for link in surfaces.moving]
        self._pairs = np.array(rows, np.intp).reshape(-1, 2)
        self._at_least = np.zeros(len(rows))
        self._poses_W: Array | None = None

    def at(self, poses_W: Array) -> tuple[float, int]:
        """Distance [m] and link; (inf, -1) without obstacles."""
        links = self._pairs[:, 0]
        if self._poses_W is not None:
            self._at_least -= self._surfaces.motion(links, self._poses_W[links], poses_W[links])
        self._poses_W = poses_W
        best, nearest = np.inf, -1
        for row in np.argsort(self._at_least):
            if self._at_least[row] >= best:
                break
            link, box = self._pairs[row]
            T_OL = self._T_OW[box] @ poses_W[link]
            distance = self._trees[box].distance(self._surfaces.trees[link], T_OL, best)[0]
            self._at_least[row] = min(distance, best)
            if distance < best:
                best, nearest = distance, int(link)
        return best, nearest


class _OwnDistance:
    """Least distance between the robot's own links, exact in its minimum over the run."""

    def __init__(self, surfaces: Surfaces) -> None:
        self._surfaces = surfaces
        self._pairs = surfaces.self_pairs
        self._at_least = np.zeros(len(self._pairs))
        self._last = np.full(len(self._pairs), np.inf)
        self._least = np.inf
        self._T_AB: Array | None = None

    def at(self, poses_W: Array) -> float:
        """Distance [m]; inf where no pair of links counts."""
        a, b = self._pairs.T
        T_AB = inverse(poses_W[a]) @ poses_W[b]
        if self._T_AB is not None:
            self._at_least -= self._surfaces.motion(b, self._T_AB, T_AB)
        self._T_AB = T_AB
        trees = self._surfaces.trees
        for row in np.argsort(self._at_least):
            if self._at_least[row] >= self._least:
                break
            bound = self._least + AHEAD_M
            found = trees[a[row]].distance(trees[b[row]], T_AB[row], bound)[0]
            distance = min(found, bound)
            self._last[row] = self._at_least[row] = distance
            self._least = min(self._least, distance)
        return float(self._last.min(initial=np.inf))

"""True distances: exact surfaces against exact surfaces, known to the simulator alone.

For the evaluation only; no controller ever sees them. What is skipped is skipped by a bound that
proves it: between two postures a distance shrinks by no more than the two surfaces moved.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from proxcgal import _core
from proxcgal.core.transforms import inverse, placed
from proxcgal.core.typing import Array
from proxcgal.models.robots import Robot
from proxcgal.models.surfaces import Surfaces, most_moved
from proxcgal.scene.obstacles import Scene

#: Looked for beyond the least distance so far, so that a far pair is not asked at every tick [m].
AHEAD_M = 0.05


class TrueDistances(NamedTuple):
    """What is true at one moment; distances [m], inf where there is nothing."""

    distance: float  #: least from a link that some joint moves to the scene
    link: str = ""  #: that link
    own: float = np.inf  #: between the robot's own links
    obstacle: str = ""  #: the solid that is nearest
    obstacle_W: Array | None = None  #: (3,) [m] its nearest point


#: Where it was not computed.
NOT_ASKED = TrueDistances(np.nan, "", np.nan)


class GroundTruth:
    """How near one robot comes to the scene and to itself, tick after tick."""

    def __init__(self, robot: Robot, scene: Scene) -> None:
        """Builds the scene's surfaces; the robot's are kept from trial to trial."""
        self._robot = robot
        surfaces = Surfaces.of(robot)
        self._scene = _SceneDistance(surfaces, scene, robot.link_names)
        self._own = _OwnDistance(surfaces)

    def __call__(self, q: Array, time: float = 0.0) -> TrueDistances:
        """What is true at a posture, with the scene where it is at `time` [s].

        The robot's own distance is asked anew whenever it could have become the least of the run,
        no farther than 0.05 m beyond that, and is the last one asked otherwise: its minimum over
        the run is exact.
        """
        poses_W = np.asarray(self._robot.link_poses(q))
        return self._scene.at(poses_W, time)._replace(own=self._own.at(poses_W))

    def nearest(self, q: Array, time: float = 0.0) -> TrueDistances:
        """The same of the scene only: `own` is not asked, nan."""
        return self._scene.at(np.asarray(self._robot.link_poses(q)), time)


class _SceneDistance:
    """Least distance from moving links to the scene's solids, exact at every call."""

    def __init__(self, surfaces: Surfaces, scene: Scene, links: Sequence[str]) -> None:
        self._surfaces, self._scene, self._links = surfaces, scene, links
        # A solid in its own frame: there a box's faces are their own bounding boxes.
        self._trees = [_core.MeshTree(*solid.core()) for solid in scene.solids]
        self._T_WO, self._T_OW = np.empty((0, 4, 4)), np.empty((0, 4, 4))
        rows = [(link, row) for row in range(len(self._trees)) for link in surfaces.moving]
        self._pairs = np.array(rows, np.intp).reshape(-1, 2)
        self._at_least = np.zeros(len(rows))
        self._sweep: Array | None = None

    def at(self, poses_W: Array, time: float) -> TrueDistances:
        """The nearest pair; without any, nothing at infinity. `own` is not asked, nan."""
        links, solids = self._pairs.T
        if self._sweep is None or not self._scene.still:
            self._T_WO = self._scene.poses(time)
            self._T_OW = inverse(self._T_WO)
        T_OL = self._T_OW[solids] @ poses_W[links]
        sweep = self._surfaces.sweep(links, T_OL)
        if self._sweep is not None:
            self._at_least -= most_moved(self._sweep, sweep)
        self._sweep = sweep
        best = NOT_ASKED._replace(distance=np.inf)
        for row in np.argsort(self._at_least):
            if self._at_least[row] >= best.distance:
                break
            link, solid = (int(index) for index in self._pairs[row])
            distance, on_core_O, on_link_O = solid_distance(
                self._trees[solid], self._scene.solids[solid].rounding,
                self._surfaces.trees[link], T_OL[row], best.distance,
            )  # fmt: skip
            self._at_least[row] = min(distance, best.distance)
            if distance < best.distance:
                apart = on_link_O - on_core_O
                far = max(float(np.linalg.norm(apart)), 1e-12)
                on_solid_O = on_core_O + apart * min(self._scene.solids[solid].rounding / far, 1.0)
                best = TrueDistances(
                    distance, self._links[link], np.nan, self._scene.names[solid],
                    placed(self._T_WO[solid], on_solid_O),
                )  # fmt: skip
        return best


def solid_distance(
    core: _core.MeshTree, rounding: float, other: _core.MeshTree, T_OL: Array, bound: float
) -> tuple[float, Array, Array]:
    """From a solid's surface to a link, where that is under `bound`; inf otherwise [m].

    Returns:
        distance, 0 where they cross; the witnesses on core and link, in the solid's frame.
    """
    distance, on_core_O, on_link_L = core.distance(other, T_OL, bound + rounding)
    return max(distance - rounding, 0.0), np.asarray(on_core_O), placed(T_OL, on_link_L)


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

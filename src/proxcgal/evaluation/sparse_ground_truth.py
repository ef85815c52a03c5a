"""True distances of a whole run, asked only where they can change a number of its summary.

A distance between two postures changes by no more than the surfaces moved. What that proves to be
no new least and no violation is not asked: least values, counts and what is asked are exact.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from proxcgal import _core
from proxcgal.core.transforms import inverse
from proxcgal.core.typing import Array, Bools
from proxcgal.evaluation.ground_truth import AHEAD_M, solid_distance
from proxcgal.models.robots import Robot
from proxcgal.models.surfaces import Surfaces, most_moved
from proxcgal.scene.obstacles import Scene
from proxcgal.scene.solids import Solid

#: Round ticks that are asked in turn: beyond, their neighbours say more.
NEAR_TICKS = 25


@dataclass(frozen=True, slots=True)
class SparseTruth:
    """True distances over n ticks."""

    distance: Array  #: (n,) [m] robot to scene, inf without a scene; nan: not asked
    link: list[str]  #: nearest to the scene, "" where not asked
    own: Array  #: (n,) [m] between the robot's own links, inf without pairs; nan: not asked


def sparse_ground_truth(
    robot: Robot, scene: Scene, time: Array, q: Array, wanted: Bools, under: float
) -> SparseTruth:
    """Distances to the scene and between own links, as `Truth` has them, where they decide.

    Args:
        robot: its full meshes are asked.
        scene: what stands and moves.
        time: (n,) [s] of each tick, in the scene's time.
        q: (n, n_q) posture of each tick.
        wanted: (n,) ticks at which the distance to the scene is asked in any case.
        under: so is it wherever it is smaller than this [m].
    """
    surfaces = Surfaces.of(robot)
    poses_W = np.array([robot.link_poses(posture) for posture in q]).reshape(len(q), -1, 4, 4)
    moving = np.array(surfaces.moving, np.intp)
    apart = _Pairs(surfaces, len(q))
    T_OW = inverse(np.array([scene.poses(moment) for moment in time]).reshape(len(q), -1, 4, 4))
    for row, solid in enumerate(scene.solids):
        tree = _core.MeshTree(*solid.core())
        for link in moving:
            apart.add(tree, int(link), T_OW[:, row] @ poses_W[:, link], solid)
    apart.ask(np.flatnonzero(wanted))
    apart.ask_least(under)
    own = _Pairs(surfaces, len(q))
    for a, b in surfaces.self_pairs:
        own.add(surfaces.trees[a], int(b), inverse(poses_W[:, a]) @ poses_W[:, b])
    own.ask_least(0.0)
    names = robot.link_names
    link = [names[apart.links[row]] if row >= 0 else "" for row in apart.nearest]
    return SparseTruth(apart.distance, link, own.distance)


def half_box(solid: Solid) -> Array:
    """(3,) half edge lengths of the box round what stands for a solid [m].

    A cylinder's prism reaches a little beyond the cylinder.
    """
    vertices_O, _ = solid.core()
    return np.asarray(np.abs(vertices_O).max(axis=0) + solid.rounding)


class _Pairs:
    """Surfaces that may come near one another, and what is known of their distances."""

    def __init__(self, surfaces: Surfaces, ticks: int) -> None:
        self._surfaces = surfaces
        self._trees: list[_core.MeshTree] = []
        self._rounding: list[float] = []
        self._T_AB: list[Array] = []
        self._sweeps: list[Array] = []
        self._at_least = np.zeros((0, ticks))
        self.links: list[int] = []  # second surface of each pair
        self.distance = np.full(ticks, np.nan)
        self.nearest = np.full(ticks, -1)

    def add(self, tree: _core.MeshTree, link: int, T_AB: Array, solid: Solid | None = None) -> None:
        """A surface, a solid's or a link's, and a link with its pose (n, 4, 4) in its frame."""
        self._trees.append(tree)
        self._rounding.append(0.0 if solid is None else solid.rounding)
        self._T_AB.append(T_AB)
        self._sweeps.append(self._surfaces.sweep(np.full(len(T_AB), link), T_AB))
        at_least = np.zeros(len(T_AB))
        if solid is not None:  # from the box round the solid to the ball round the link
            outside = np.maximum(np.abs(self._sweeps[-1][:, :3]) - half_box(solid), 0.0)
            far = np.sqrt(np.einsum("ni,ni->n", outside, outside))
            at_least = np.maximum(far - self._surfaces.radii[link], 0.0)
        self._at_least = np.vstack([self._at_least, at_least])
        self.links.append(link)

    def ask_least(self, under: float) -> None:
        """Asks until no other tick can have the least distance, or one smaller than `under`."""
        if not self.links:
            self.distance[:] = np.inf
            return
        least = np.inf
        at_least = self._at_least.min(axis=0)
        while len(at_least):
            tick = int(at_least.argmin())
            if at_least[tick] >= max(least, under):
                return
            self._ask(tick)
            least = min(least, self.distance[tick])
            at_least = self._at_least.min(axis=0)
            at_least[np.isfinite(self.distance)] = np.inf

    def ask(self, ticks: NDArray[np.intp]) -> None:
        """Asks these ticks, unless they were."""
        if self.links:
            for tick in ticks:
                if np.isnan(self.distance[tick]):
                    self._ask(int(tick), NEAR_TICKS)

    def _ask(self, tick: int, near: int | None = None) -> None:
        """Asks one tick; what follows for so many ticks to either side, or for all, is noted."""
        ticks = slice(None) if near is None else slice(max(tick - near, 0), tick + near + 1)
        best, nearest = np.inf, -1
        for row in np.argsort(self._at_least[:, tick]):
            if self._at_least[row, tick] >= best:
                break
            bound = best + AHEAD_M
            other, T_AB = self._surfaces.trees[self.links[row]], self._T_AB[row][tick]
            found = solid_distance(self._trees[row], self._rounding[row], other, T_AB, bound)
            distance = min(found[0], bound)
            sweep, known = self._sweeps[row], self._at_least[row, ticks]
            moved = most_moved(sweep[tick : tick + 1], sweep[ticks])
            np.maximum(known, distance - moved, out=known)
            if distance < best:
                best, nearest = distance, int(row)
        self.distance[tick], self.nearest[tick] = best, nearest

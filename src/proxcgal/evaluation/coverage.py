"""What the sensors had in view of what mattered: the truly closest points of a run."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from proxcgal.core.transforms import inverse, placed
from proxcgal.core.typing import Array
from proxcgal.evaluation.ground_truth import GroundTruth
from proxcgal.evaluation.visibility import Visibility
from proxcgal.scenario.setup import Setup

EVERY_S = 0.2  #: [s] from one closest point to the next that is looked at


@dataclass(frozen=True, slots=True)
class Coverage:
    """Shares of the closest points, which add up to 1; nan where there was no scene."""

    in_view: float = np.nan  #: in view at the last scan
    remembered: float = np.nan  #: not then, but within the `memory_s` before
    forgotten: float = np.nan  #: longer ago
    never_seen: float = np.nan

    def numbers(self) -> dict[str, float]:
        """As summaries have them."""
        return {f"{name}_share": float(share) for name, share in asdict(self).items()}


#: Where it was not evaluated.
NO_COVERAGE = Coverage()


@dataclass(frozen=True, slots=True)
class Sighting:
    """What the sensors had of the truly closest point at one moment."""

    kind: Literal["in_view", "remembered", "forgotten", "never_seen"]
    age_s: float  #: [s] from the last scan that had it in view to then, inf: none had


def coverage_of(setup: Setup, q: Array, elapsed: Array) -> Coverage:
    """How long ago the sensors had each truly closest point in view.

    It says what could be known, by any controller: a point counts as remembered whether or not one
    with memory ran.

    Args:
        setup: scenario, robot, sensors and scene.
        q: (n, n_q) posture of each tick.
        elapsed: (n,) [s] since the run began.
    """
    if not setup.measured.solids or not len(elapsed):
        return NO_COVERAGE
    step = max(round(EVERY_S / (elapsed[1] - elapsed[0])) if len(elapsed) > 1 else 1, 1)
    found = [one.kind for one in sightings(setup, q, elapsed, range(0, len(elapsed), step))]
    return Coverage(*(found.count(kind) / len(found) for kind in (
        "in_view", "remembered", "forgotten", "never_seen"
    )))  # fmt: skip


def sightings(setup: Setup, q: Array, elapsed: Array, ticks: Sequence[int]) -> tuple[Sighting, ...]:
    """How long ago the sensors had the truly closest point of each of these ticks in view.

    Args:
        setup: scenario, robot, sensors and scene, which holds something.
        q: (n, n_q) posture of each tick of the run.
        elapsed: (n,) [s] since the run began.
        ticks: rows of these, ascending.
    """
    memory_s = setup.scenario.controller.memory.memory_s
    scan_s = 1.0 / setup.scenario.simulation.sensor_hz
    rows = np.asarray(ticks, np.intp)
    moments, postures = elapsed[rows], q[rows]
    truth, names = GroundTruth(setup.robot, setup.measured), list(setup.measured.names)
    solids = np.zeros(len(moments), np.intp)
    points_O = np.zeros((len(moments), 3))  # on their solids, which may move
    for row, (moment, posture) in enumerate(zip(moments, postures, strict=True)):
        nearest = truth.nearest(posture, moment)
        assert nearest.obstacle_W is not None
        solids[row] = names.index(nearest.obstacle)
        T_OW = inverse(setup.measured.poses(moment))[solids[row]]
        points_O[row] = placed(T_OW, nearest.obstacle_W)
    seen = _last_seen(setup, q, elapsed, moments, solids, points_O)
    ages = moments - seen
    current = np.floor(moments / scan_s + 1e-9) * scan_s
    kinds = np.select(
        [seen >= current - 1e-9, ages <= memory_s, np.isfinite(seen)],
        ["in_view", "remembered", "forgotten"],
        "never_seen",
    )
    return tuple(Sighting(kind.item(), float(age)) for kind, age in zip(kinds, ages, strict=True))


def _last_seen(
    setup: Setup,
    q: Array,
    elapsed: Array,
    moments: Array,
    solids: NDArray[np.intp],
    points_O: Array,
) -> Array:
    """(n,) [s] stamp of the last scan up to each moment that had its point in view, -inf: none."""
    scan_s = 1.0 / setup.scenario.simulation.sensor_hz
    visibility = Visibility(setup, setup.scene)
    seen = np.full(len(moments), -np.inf)
    for scan in range(int(np.floor(moments[-1] / scan_s + 1e-9)), -1, -1):
        stamp = scan * scan_s
        open_rows = np.flatnonzero((moments >= stamp - 1e-9) & np.isinf(seen))
        if not len(open_rows):
            continue
        posture = np.array([np.interp(stamp, elapsed, joint) for joint in q.T])
        T_WO = setup.measured.poses(stamp)[solids[open_rows]]
        points_W = np.einsum("nij,nj->ni", T_WO[:, :3, :3], points_O[open_rows]) + T_WO[:, :3, 3]
        seen[open_rows[visibility.see(posture, points_W, stamp)]] = stamp
    return seen

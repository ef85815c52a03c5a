"""One moment of a run as a page draws it: plain arrays, without the controller behind them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from proxcgal import _core
from proxcgal.sim.setup import Setup
from proxcgal.sim.ticks import TickInput, TickResult

Array = NDArray[np.float64]
Points = NDArray[np.float32]

MODES = ("RUN", "DEGRADED", "HOLD", "STOP")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Moment:
    """What one tick looked like."""

    elapsed: float  #: [s] of the run
    q: Array  #: (n_q,)
    links_W: Array  #: (links, 4, 4) T_WL
    solids_W: Array  #: (solids, 4, 4) T_WO
    goal_W: Array  #: (4, 4) T_WT
    kept_W: Points  #: (n, 3) the filtered cloud, without `held_W` [m]
    held_W: Points  #: (n, 3) of it, what sensors that are silent now saw last [m]
    removed_W: Points  #: (n, 3) of the raw cloud, what was taken for the arm [m]
    control_W: tuple[float, ...] | None  #: (3,) the point that avoidance moves
    obstacle_W: tuple[float, ...] | None  #: (3,) the point that it moves away from
    link: str  #: that avoidance moves
    seen: float  #: [m] cloud to robot
    true: float  #: [m] scene to robot
    activation: float  #: of avoidance
    mode: int  #: row of MODES
    found: tuple[str, ...]  #: reasons of the findings
    tick_us: float  #: wall time of the tick
    qd: Array  #: (n_q,) commanded

    @classmethod
    def of(
        cls,
        setup: Setup,
        given: TickInput,
        result: TickResult,
        law: _core.Controller | None,
        time: float,
        *,
        true: float,
        since: float = 0.0,
        off: Collection[int] = (),
    ) -> Self:
        """Of a tick that `law` has just made.

        Args:
            setup: of the run.
            given: the tick's inputs.
            result: its answer.
            law: the controller, whose clouds are copied; None: clouds are not known.
            time: the scene's, for its poses [s].
            true: distance from scene to robot [m].
            since: added to `time` in what is shown [s].
            off: rows of the sensors that are silent.
        """
        kept, raw, held = np.empty((0, 3)), np.empty((0, 3)), np.empty(0, bool)
        if law is not None:
            kept, raw = law.cloud_W(), law.raw_cloud_W()
            held = np.isin(law.cloud_origins()[:, 0], list(off))
        return cls(
            elapsed=since + time,
            q=given.q,
            links_W=np.asarray(setup.robot.link_poses(given.q)),
            solids_W=np.asarray(setup.scene.poses(time)),
            goal_W=given.goal,
            kept_W=kept[~held].astype(np.float32),
            held_W=kept[held].astype(np.float32),
            removed_W=without(raw, kept).astype(np.float32),
            control_W=result.control_W,
            obstacle_W=result.obstacle_W,
            link=result.control_link,
            seen=result.seen,
            true=true,
            activation=result.activation(),
            mode=result.mode,
            found=tuple(dict.fromkeys(found.reason for found in result.findings)),
            tick_us=result.tick_us,
            qd=result.qd,
        )


def without(points: Array, some: Array) -> Array:
    """Those rows of (n, 3) that are not among the rows of `some`, bit for bit."""
    if not len(points) or not len(some):
        return points
    left: Array = points[~np.isin(_rows(points), _rows(some))]
    return left


def _rows(points: Array) -> NDArray[np.void]:
    """(n,) each row as one value that compares by its bytes."""
    return np.ascontiguousarray(points).view(np.dtype((np.void, 3 * points.itemsize))).ravel()

"""One moment of a run as a page draws it: plain arrays, without the controller behind them."""

from dataclasses import dataclass, field
from typing import Self

import numpy as np

from proxcgal.core.typing import Array, Bools
from proxcgal.scenario.setup import Setup
from proxcgal.sim.clouds import Clouds, Points
from proxcgal.sim.tick import TickInput, TickResult

_NOTHING = 9.0  # [m] as far as that is nothing


def _no_points() -> Points:
    return np.empty((0, 3), np.float32)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Posed:
    """Where everything is."""

    elapsed: float  #: [s] of the run
    q: Array  #: (n_q,)
    links_W: Array  #: (links, 4, 4) T_WL
    solids_W: Array  #: (solids, 4, 4) T_WO
    goal_W: Array | None  #: (4, 4) T_WT; None: there is none to draw
    hand_W: Array | None = None  #: (4, 4) of the hand at the tool, held or not; None: there is none
    gripped: bool = False  #: does a user hold that hand?
    kept_W: Points = field(
        default_factory=_no_points
    )  #: (n, 3) the filtered cloud, without `held_W` [m]
    held_W: Points = field(
        default_factory=_no_points
    )  #: (n, 3) of it, what sensors that are silent now saw last [m]
    removed_W: Points = field(
        default_factory=_no_points
    )  #: (n, 3) of the raw cloud, what was taken for the arm [m]
    control_W: tuple[float, ...] | None = None  #: (3,) where the arrow begins
    obstacle_W: tuple[float, ...] | None = None  #: (3,) where it points to


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Moment(Posed):
    """What one tick looked like; the arrow goes from what avoidance moves to what it avoids."""

    link: str  #: that avoidance moves
    seen: float  #: [m] cloud to robot
    true: float  #: [m] scene to robot
    activation: float  #: of avoidance
    mode: int  #: as in core.modes
    found: tuple[str, ...]  #: reasons of the findings
    tick_us: float  #: wall time of the tick
    qd: Array  #: (n_q,) commanded

    @classmethod
    def of(
        cls,
        setup: Setup,
        inputs: TickInput,
        result: TickResult,
        clouds: Clouds | None,
        time: float,
        *,
        q: Array,
        true: float,
        since: float = 0.0,
        held: Bools | None = None,
        hand_W: Array | None = None,
        gripped: bool = False,
    ) -> Self:
        """Of one tick.

        Args:
            setup: of the run.
            inputs: the tick's inputs.
            result: its answer.
            clouds: the controller's after that tick; None: not known.
            time: the scene's, for its poses [s].
            q: (n_q,) where the arm is, whatever a fault reports.
            true: distance from scene to robot [m].
            since: added to `time` in what is shown [s].
            held: (n,) true for the kept points of sensors that are silent; left out: none.
            hand_W: (4, 4) of a hand at the tool.
            gripped: a user holds it.
        """
        clouds = clouds or Clouds(_no_points(), _no_points())
        held = np.zeros(len(clouds.kept_W), bool) if held is None else held
        return cls(
            elapsed=since + time,
            q=q,
            links_W=np.asarray(setup.robot.link_poses(q)),
            solids_W=np.asarray(setup.drawn.poses(time)),
            goal_W=inputs.goal,
            hand_W=hand_W,
            gripped=gripped,
            kept_W=clouds.kept_W[~held],
            held_W=clouds.kept_W[held],
            removed_W=clouds.removed_W,
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


def metres(distance: float) -> str:
    """A distance as text; nan where it is unknown, inf where there is nothing."""
    if np.isnan(distance):
        return "unknown"
    return f"{distance:.3f} m" if distance < _NOTHING else "none"

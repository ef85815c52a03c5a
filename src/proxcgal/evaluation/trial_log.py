"""One run as arrays over its ticks, and its numbers."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from proxcgal.core.typing import Array, Bools
from proxcgal.evaluation.coverage import NO_COVERAGE, Coverage, Sighting
from proxcgal.evaluation.termination import Ending
from proxcgal.models.robots import Robot
from proxcgal.sim.tick import TaskResult, Tick, TickResult

NOTHING = 9.99  #: [m] stands for the distance to nothing
TOO_CLOSE = 0.05  #: [m] a true distance under it is a violation
FINAL = 2.0  #: [s] of the end that `true_final_m` is the mean of


@dataclass(frozen=True, eq=False)
class TrialLog:
    """What happened in each of n ticks."""

    scenario: str
    robot: str
    controller: str
    seed: int
    wall_s: float  #: [s] what the run took
    time: Array  #: (n,) [s] the caller's clock, which a fault can make jump
    elapsed: Array  #: (n,) [s] since the run began
    q: Array  #: (n, n_q)
    qd: Array  #: (n, n_q) commanded
    seen_m: Array  #: (n,) cloud to robot, inf where nothing is seen
    true_m: Array  #: (n,) scene to robot, inf where there is no scene, nan where not asked
    true_link: list[str]  #: the link that is nearest to the scene, "" where not asked
    self_m: Array  #: (n,) between the robot's own links, nan where not asked
    activation: Array  #: (n,) of avoidance
    control_link: list[str]  #: the link that avoidance moves, "" for none
    pair_surface_W: Array  #: (n, 3) the point that avoidance moves, nan for none
    pair_obstacle_W: Array  #: (n, 3) the obstacle point, nan for none
    tool_W: Array  #: (n, 3)
    goal_error_m: Array  #: (n,)
    goal_angle_rad: Array  #: (n,)
    mode: NDArray[np.int64]  #: (n,) as in core.modes
    cloud_points: NDArray[np.int64]  #: (n,) that the filter kept
    leaked_points: NDArray[np.int64]  #: (n,) of those, how many really are the robot itself
    findings: dict[str, int]  #: in how many ticks each reason was found
    tick_us: Array  #: (n,) wall time of the controller's call
    coverage: Coverage = NO_COVERAGE  #: nan where not asked for
    #: Of the truly closest point at the nearest tick and at the last; None as above, or no scene.
    sightings: tuple[Sighting, Sighting] | None = None
    recording_failure: str | None = None  #: why the recording stopped early
    ending: Ending | None = None  #: how it ended, where a scene says when a run is over
    task_names: tuple[str, ...] = ()  #: of each level, the most important first
    task_activation: Array = field(default_factory=lambda: np.zeros((0, 0)))  #: (n, k) largest row
    task_rate: Array = field(default_factory=lambda: np.zeros((0, 0)))  #: (n, k) |reference rate|
    task_residual: Array = field(default_factory=lambda: np.zeros((0, 0)))  #: (n, k) |A residual|

    @classmethod
    def of(
        cls,
        ticks: Sequence[Tick],
        robot: Robot,
        *,
        scenario: str,
        controller: str,
        seed: int,
        wall_s: float,
        elapsed: Array | None = None,
        recording_failure: str | None = None,
        ending: Ending | None = None,
    ) -> Self:
        """Puts ticks together; without `elapsed` the caller's clock is believed."""
        inputs = [tick.inputs for tick in ticks]
        results = [tick.result for tick in ticks]
        truths = [tick.truth for tick in ticks]
        time = np.array([g.time for g in inputs])
        tools = np.array([_tool(robot, g.q) for g in inputs]).reshape(-1, 4, 4)
        goals = np.array([g.goal for g in inputs]).reshape(-1, 4, 4)
        found = Counter(
            reason for r in results for reason in sorted({f.reason for f in r.findings})
        )
        return cls(
            scenario=scenario,
            robot=robot.name,
            controller=controller,
            seed=seed,
            wall_s=wall_s,
            time=time,
            elapsed=time if elapsed is None else elapsed,
            q=np.array([g.q for g in inputs]).reshape(-1, robot.n_q),
            qd=np.array([r.qd for r in results]).reshape(-1, robot.n_q),
            seen_m=np.array([r.seen for r in results]),
            true_m=np.array([t.distance for t in truths]),
            true_link=[t.link for t in truths],
            self_m=np.array([t.own for t in truths]),
            activation=np.array([r.activation() for r in results]),
            control_link=[r.control_link for r in results],
            pair_surface_W=_points([r.control_W for r in results]),
            pair_obstacle_W=_points([r.obstacle_W for r in results]),
            tool_W=tools[:, :3, 3],
            goal_error_m=np.linalg.norm(goals[:, :3, 3] - tools[:, :3, 3], axis=1),
            goal_angle_rad=_angles(tools[:, :3, :3], goals[:, :3, :3]),
            mode=np.array([r.mode for r in results], np.int64),
            cloud_points=np.array([r.cloud_points for r in results], np.int64),
            leaked_points=np.array([t.leaked for t in truths], np.int64),
            findings=dict(found),
            tick_us=np.array([r.tick_us for r in results]),
            recording_failure=recording_failure,
            ending=ending,
            **_tasks(results),
        )

    @property
    def nearest_tick(self) -> int:
        """The first of those that are truly nearest to the scene; 0 where none was asked."""
        asked = np.where(np.isnan(self.true_m), np.inf, self.true_m)
        return int(asked.argmin()) if len(asked) else 0

    def summary(self) -> dict[str, float | int]:
        """The run's numbers, as experiments report them; distances in metres."""
        ends = np.minimum(self.true_m, NOTHING)[final_ticks(self.elapsed)]
        return {
            "true_min_m": _least(self.true_m),
            "true_final_m": min(float(ends.mean()), NOTHING) if len(ends) else NOTHING,
            "seen_min_m": _least(self.seen_m),
            "goal_error_m": float(self.goal_error_m[-1]) if len(self.time) else 0.0,
            "violations": int((self.true_m < TOO_CLOSE).sum()),
            "self_min_m": _least(self.self_m),
            "leaked_points_max": int(self.leaked_points.max(initial=0)),
            "wall_s": self.wall_s,
        }


def _tasks(results: Sequence[TickResult]) -> dict[str, Any]:
    """What each level wanted and got, as the log has it."""
    names = max((tuple(t.name for t in r.tasks) for r in results), key=len, default=())

    def column(result: TickResult, form: Callable[[TaskResult], float]) -> list[float]:
        return [form(task) for task in result.tasks] or [0.0] * len(names)

    def table(form: Callable[[TaskResult], float]) -> Array:
        return np.array([column(r, form) for r in results]).reshape(len(results), len(names))

    return {
        "task_names": names,
        "task_activation": table(lambda t: max(t.activation, default=0.0)),
        "task_rate": table(lambda t: math.hypot(*t.rate)),
        "task_residual": table(
            lambda t: math.hypot(*(a * r for a, r in zip(t.activation, t.residual, strict=True)))
        ),
    }


def final_ticks(elapsed: Array) -> Bools:
    """(n,) true for the ticks that `true_final_m` is the mean of; `elapsed` as in the log."""
    return elapsed >= elapsed[-1:] - FINAL if len(elapsed) else np.zeros(0, bool)


def sampled_ticks(elapsed: Array, hz: float) -> Bools:
    """(n,) true for the first tick of every period, from the first tick on; 0 Hz: for none."""
    beats = np.floor(elapsed * hz + 1e-9)
    return np.diff(beats, prepend=-1.0 if hz > 0.0 else 0.0) > 0.0


def _least(distances: Array) -> float:
    """Of those that were asked; nan where none was."""
    return float(min(np.fmin.reduce(distances, initial=np.inf), NOTHING))


def _points(points: Sequence[Sequence[float] | None]) -> Array:
    return np.array([p or (np.nan,) * 3 for p in points], np.float64).reshape(-1, 3)


def _tool(robot: Robot, q: Array) -> Array:
    """(4, 4) T_WT; nan where a fault reports no posture."""
    return np.asarray(robot.tool_pose(q)) if np.isfinite(q).all() else np.full((4, 4), np.nan)


def _angles(here: Array, there: Array) -> Array:
    """(n,) rotation angle between (n, 3, 3) orientations [rad]; accurate near 0 too."""
    chord = np.linalg.norm(there - here, axis=(1, 2)) / np.sqrt(8.0)
    return np.asarray(2.0 * np.arcsin(np.clip(chord, 0.0, 1.0)))

"""One tick as plain data: what went in, what came out, what was true.

The same three records are logged, written, read back and compared.
"""

from dataclasses import dataclass, field
from typing import Self

import numpy as np

from proxcgal import _core
from proxcgal.core.typing import Array


@dataclass(frozen=True, slots=True)
class TickInput:
    """Everything a tick is given: with it, the tick can be repeated bit for bit."""

    time: float  #: [s] the caller's clock
    q: Array  #: (n_q,) measured
    goal: Array  #: (4, 4) T_WT
    scans: tuple[_core.Scan, ...] = ()  #: since the last tick
    known: bool = False  #: the scene's own points are given instead of scans
    late: bool = False  #: the caller missed its deadline
    q_stamp: float | None = None  #: [s] when q was measured; None: just now


@dataclass(frozen=True, slots=True)
class Found:
    """A finding of the monitor."""

    reason: str
    sensor: int = -1
    zone: int = -1
    link: str | None = None
    age: float = 0.0  #: [s]
    count: int = 1


@dataclass(frozen=True, slots=True)
class TaskResult:
    """What one task wanted and got, row by row."""

    name: str
    rate: tuple[float, ...]
    activation: tuple[float, ...]
    residual: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class TickResult:
    """What a tick answered."""

    qd: Array  #: (n_q,)
    mode: int  #: as in core.modes
    seen: float = np.inf  #: [m] closest pair between cloud and robot
    link: str = ""  #: that pair's link on the robot
    surface_W: tuple[float, ...] | None = None  #: (3,) [m] that pair's point on the robot
    obstacle_W: tuple[float, ...] | None = None  #: (3,) [m] that pair's obstacle point
    sensor: int = -1  #: that saw the obstacle point
    zone: int = -1
    age: float = 0.0  #: [s] since that point was measured
    remembered: bool = False  #: no current scan shows that point any more
    velocity_W: tuple[float, ...] = (0.0, 0.0, 0.0)  #: (3,) [m/s] that obstacle's, as taken
    control_W: tuple[float, ...] | None = None  #: (3,) [m] the point that avoidance moves
    control_link: str = ""  #: its link
    cloud_points: int = 0  #: that the filter kept
    tasks: tuple[TaskResult, ...] = ()
    findings: tuple[Found, ...] = ()
    tick_us: float = field(default=0.0, compare=False)  #: wall time of the call
    cpu_us: float = field(default=0.0, compare=False)  #: the thread's own, not recorded

    @classmethod
    def of(
        cls, out: _core.TickOutput, cloud_points: int, tick_us: float, cpu_us: float = 0.0
    ) -> Self:
        """Copies the controller's answer."""
        pair = out.pair
        return cls(
            qd=np.array(out.qd),
            mode=int(out.mode.value),
            seen=pair.distance if pair else np.inf,
            link=pair.link if pair else "",
            surface_W=_floats(pair.surface_W) if pair else None,
            obstacle_W=_floats(pair.obstacle_W) if pair else None,
            sensor=out.pair_sensor,
            zone=out.pair_zone,
            age=out.pair_age,
            remembered=out.pair_remembered,
            velocity_W=_floats(out.obstacle_velocity_W),
            control_W=None if out.control_W is None else _floats(out.control_W),
            control_link=out.control_link,
            cloud_points=cloud_points,
            tasks=tuple(
                TaskResult(t.name, _floats(t.rate), _floats(t.activation), _floats(t.residual))
                for t in out.tasks
            ),
            findings=tuple(
                Found(f.reason, f.sensor, f.zone, f.link, f.age, f.count) for f in out.findings
            ),
            tick_us=tick_us,
            cpu_us=cpu_us,
        )

    def same(self, other: Self) -> bool:
        """Bit for bit, the time it took apart; equal NaNs count as the same."""
        return repr(self._compared()) == repr(other._compared())

    def activation(self) -> float:
        """Of avoidance: its most active row, 0 where that task is not in the stack."""
        rows = [a for task in self.tasks if task.name == "avoidance" for a in task.activation]
        return max(rows, default=0.0)

    def _compared(self) -> tuple[object, ...]:
        return (
            self.qd.tolist(), self.mode, self.seen, self.link, self.surface_W, self.obstacle_W,
            self.sensor, self.zone, self.age, self.remembered, self.velocity_W, self.control_W,
            self.control_link, self.cloud_points, self.tasks, self.findings,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class TickTruth:
    """What only the simulator knows, at the posture the tick was given."""

    distance: float = np.inf  #: [m] exact surfaces of robot and scene
    link: str = ""  #: nearest to the scene
    own: float = np.inf  #: [m] between the robot's own links
    leaked: int = 0  #: points of the filtered cloud that really are the robot itself


#: Of a real robot.
UNKNOWN = TickTruth(distance=np.nan, own=np.nan)


@dataclass(frozen=True, slots=True)
class Tick:
    """One tick, whole."""

    inputs: TickInput
    result: TickResult
    truth: TickTruth


def _floats(values: Array) -> tuple[float, ...]:
    return tuple(np.asarray(values).tolist())

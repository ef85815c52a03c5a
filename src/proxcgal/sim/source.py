"""Where a tick's inputs come from: simulated sensors on a simulated arm, or a recording."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from proxcgal import _core
from proxcgal.core.typing import Array, Bools
from proxcgal.scenario.setup import Setup
from proxcgal.sim.actuation import Actuation
from proxcgal.sim.faults import RealMounts
from proxcgal.sim.range_sensor import ZONES, RangeModel
from proxcgal.sim.tick import TickInput
from proxcgal.sim.waypoints import Waypoints
from proxcgal.sim.world import Hits, World

_BEFORE = 1 << 20  # index of the scans before the run: their noise is none of the run's


class Source(Protocol):
    """Gives a run its inputs, and takes its commands."""

    def read(self) -> TickInput | None:
        """The next tick's inputs; None at the end."""

    def command(self, qd: Array) -> None:
        """Velocity until the next tick (n_q,)."""


class RecordedSource:
    """The inputs of a recording, as they were; commands change nothing."""

    def __init__(self, inputs: Sequence[TickInput]) -> None:
        """Args: `inputs` in their order."""
        self._inputs = iter(inputs)

    def read(self) -> TickInput | None:
        """The next recorded inputs; None at the end."""
        return next(self._inputs, None)

    def command(self, qd: Array) -> None:
        """Nothing moves: it happened already."""


class SimulatedSource:
    """The arm follows its velocity commands exactly, the sensors measure on the way.

    A scan is measured where the arm was at the scan's own stamp, and delivered to the first tick
    at or after it.
    """

    def __init__(self, setup: Setup, world: World | None, seed: int) -> None:
        """Args: without a `world` nothing is sensed."""
        settings = setup.scenario.simulation
        goal = setup.scenario.goal
        self._setup = setup
        self._waypoints = Waypoints(setup.goals, goal.arrival, goal.patience)
        self._world = world
        self._period = 1.0 / settings.control_hz
        self._ticks = max(round(setup.scenario.duration * settings.control_hz), 1)
        self._tick = 0
        self._arm = Actuation(setup.q0, self._period)
        sensors = len(setup.skin)
        self._ranges = RangeModel(settings, setup.scenario.skin.sensor, sensors, seed)
        self._mounting = settings.mounting
        self._scan_hz = settings.sensor_hz
        turns = np.arange(sensors) / sensors if settings.stagger else np.zeros(sensors)
        self._phase: Array = turns / settings.sensor_hz
        self._scans = np.zeros(sensors, np.int64)
        self._mounts = RealMounts(setup.robot, setup.skin.mounts, setup.scenario.faults, seed)
        #: (sensors, 64) true where the last scan really saw the robot itself.
        self.saw_robot: Bools = np.zeros((sensors, ZONES), bool)

    @property
    def q(self) -> Array:
        """(n_q,) where the arm really is."""
        return self._arm.q

    def standing(self, scans: int) -> list[_core.Scan]:
        """What every sensor would send before the run, the arm at rest where it starts."""
        assert self._world is not None
        rows = list(range(len(self._scans)))
        hits = self._cast(rows, 0.0, self._setup.q0)
        return [
            scan
            for index in range(_BEFORE, _BEFORE + scans)
            for scan in self._scans_of(rows, index, 0.0, hits)
        ]

    def read(self) -> TickInput | None:
        """Moves the arm by the last command and collects the scans made on the way."""
        if self._tick == self._ticks:
            return None
        time = self._tick * self._period
        start = time - self._period
        if self._tick > 0:
            self._arm.step()
        scans: list[_core.Scan] = []
        while self._world is not None:
            stamps = self._scans / self._scan_hz + self._phase
            stamp = float(stamps.min())
            if stamp > time:
                break
            rows = [int(row) for row in np.flatnonzero(stamps == stamp)]
            scans += self._measure(rows, stamp, self._arm.within_step(stamp - start))
        self._tick += 1
        goal = self._waypoints.at(time, np.asarray(self._setup.robot.tool_pose(self.q))[:3, 3])
        return TickInput(time, self.q, goal, tuple(scans), self._world is None)

    def command(self, qd: Array) -> None:
        """Velocity until the next tick (n_q,)."""
        self._arm.qd = qd

    def _measure(self, rows: list[int], stamp: float, q: Array) -> list[_core.Scan]:
        """Scans of the sensors that measure together; they share one index."""
        assert self._world is not None
        hits = self._cast(rows, stamp, q)
        scans = self._scans_of(rows, int(self._scans[rows[0]]), stamp, hits)
        self.saw_robot[rows] = self._ranges.pick(hits.length, hits.robot)
        self._scans[rows] += 1
        return scans

    def _scans_of(self, rows: list[int], index: int, stamp: float, hits: Hits) -> list[_core.Scan]:
        ranges, status = self._ranges.measure(rows, index, hits.length)
        return [
            _core.Scan(row, index, stamp, ranges[at], status[at]) for at, row in enumerate(rows)
        ]

    def _cast(self, rows: list[int], time: float, q: Array) -> Hits:
        """What the rays of some sensors meet, from where these really are."""
        assert self._world is not None
        self._world.place(q, time)
        T_WS = self._mounts.poses_W(q, time, rows)
        directions_W = self._ranges.rays_S @ np.swapaxes(T_WS[:, :3, :3], 1, 2)
        return self._world.cast(T_WS[:, :3, 3], directions_W, self._mounting)

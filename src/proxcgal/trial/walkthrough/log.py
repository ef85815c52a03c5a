"""One walk-through as arrays over its cycles, and its numbers."""

from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np

from proxcgal import _core
from proxcgal.core.typing import Array, Bools
from proxcgal.scenario.walkthrough_keys import GuardKeys
from proxcgal.sim.physics import GuardTruth, Physics


@dataclass(frozen=True, slots=True, kw_only=True)
class Trip:
    """Why and when the torque was cut."""

    cycle: int
    time_s: float
    function: str
    value: float
    limit: float


@dataclass(eq=False)
class WalkLog:
    """What happened in each of n cycles; filled one by one, cut to length at the end."""

    period: float  #: [s]
    rest_speed: float  #: [rad/s] of every joint, at rest
    tcp_limit: float  #: [m/s]
    distance_limit: float  #: [m]
    velocity_limit: float  #: [m/s]
    time: Array  #: (n,) [s]
    q: Array  #: (n, n_q) [rad] measured
    qd: Array  #: (n, n_q) [rad/s] measured
    tool_W: Array  #: (n, 3) [m]
    force: Array  #: (n,) [N] of the hand
    tcp_speed: Array  #: (n,) [m/s] by the guard
    distance: Array  #: (n,) [m] by the guard
    velocity: Array  #: (n,) [m/s] by the guard
    protective_m: Array  #: (n,) [m] ISO/TS 15066 at that velocity
    speed_ratio: Array  #: (n,) largest |qd| / qd_UB
    acceleration_ratio: Array  #: (n,) largest |qdd| / qdd_UB
    torque: Bools  #: (n,) the STO signal
    true_tcp_speed: Array  #: (n,) [m/s] by the simulator, nan where not asked
    true_distance: Array  #: (n,) [m]
    true_velocity: Array  #: (n,) [m/s]
    true_speed_ratio: Array  #: (n,)
    true_acceleration_ratio: Array  #: (n,)
    trips: list[Trip] = field(default_factory=list)
    overrun: bool = False
    cycles: int = 0
    left_m: float | None = None  #: of the tool from where the intended path ends; None after a trip

    @classmethod
    def empty(cls, cycles: int, joints: int, period: float, keys: GuardKeys) -> Self:
        """Room for so many cycles under a guard with these keys."""
        columns: dict[str, Any] = {name: np.full(cycles, np.nan) for name in _COLUMNS}
        return cls(
            period=period, rest_speed=keys.rest_speed, tcp_limit=keys.tcp_speed,
            distance_limit=keys.min_distance, velocity_limit=keys.max_velocity,
            q=np.zeros((cycles, joints)), qd=np.zeros((cycles, joints)),
            tool_W=np.zeros((cycles, 3)), torque=np.zeros(cycles, np.bool_), **columns,
        )  # fmt: skip

    def add(
        self,
        time: float,
        physics: Physics,
        out: _core.GuardOutput,
        force: Array | None,
        truth: GuardTruth | None,
        bounds: tuple[Array, Array],
    ) -> None:
        """One cycle more; `bounds` are qd_UB and qdd_UB, for what is true."""
        k = self.cycles
        self.time[k] = time
        for name in ("q", "qd", "tool_W"):
            getattr(self, name)[k] = getattr(physics, name)
        self.force[k] = 0.0 if force is None else np.sqrt(force[:3] @ force[:3])
        for name in (*_TRUE, "speed_ratio", "acceleration_ratio", "torque"):
            getattr(self, name)[k] = getattr(out, name)
        self.protective_m[k] = out.protective_distance
        self.overrun = self.overrun or out.overrun
        if out.trips > len(self.trips):
            trip = out.trip
            self.trips.append(
                Trip(cycle=k, time_s=trip.time, function=trip.function, value=trip.value,
                     limit=trip.limit)
            )  # fmt: skip
        if truth is not None:
            for name in _TRUE:
                getattr(self, f"true_{name}")[k] = getattr(truth, name)
            self.true_speed_ratio[k] = (np.abs(physics.qd) / bounds[0]).max()
            self.true_acceleration_ratio[k] = (np.abs(physics.acceleration) / bounds[1]).max()
        self.cycles += 1

    def cut(self) -> Self:
        """Itself, without the cycles that did not come."""
        for name in ("q", "qd", "tool_W", "torque", *_COLUMNS):
            setattr(self, name, getattr(self, name)[: self.cycles])
        return self

    def stop_time_s(self) -> float | None:
        """From the first trip to rest, as simulated [s]; None without a trip, inf without rest."""
        if not self.trips:
            return None
        rest = np.abs(self.qd[self.trips[0].cycle :]).max(axis=1) <= self.rest_speed
        # At rest and from then on: a stop is over when nothing moves any more.
        moving = np.flatnonzero(~rest)
        first = int(moving[-1]) + 1 if len(moving) else 0
        return first * self.period if first < len(rest) else float("inf")

    def stop_distance_m(self) -> float | None:
        """Way of the tool from the first trip to rest [m]; None without a trip."""
        if not self.trips:
            return None
        way = np.diff(self.tool_W[self.trips[0].cycle :], axis=0)
        return float(np.linalg.norm(way, axis=1).sum())

    def max_tcp_speed(self) -> float:
        """While the torque was on [m/s]."""
        return float(self.tcp_speed[self.torque].max(initial=0.0))

    def peak_after_cut(self) -> float | None:
        """Of the tool once the torque is cut: it may speed up before the brakes hold [m/s]."""
        return float(self.tcp_speed[self.trips[0].cycle :].max()) if self.trips else None

    def truly_violated(self) -> Bools:
        """(n,) cycles under torque in which the simulator itself finds a bound violated.

        Its kinematics, distances and accelerations are MuJoCo's own; what differs from the guard's
        by rounding alone does not count.
        """
        under_torque = np.r_[False, self.torque[:-1]]
        return np.asarray(
            under_torque
            & (
                (self.true_tcp_speed > self.tcp_limit + _ROUNDING)
                | (self.true_speed_ratio > 1.0 + _ROUNDING)
                | (self.true_acceleration_ratio > 1.0 + _ROUNDING)
                | (self.true_distance < self.distance_limit - _ROUNDING)
                | (self.true_velocity > self.velocity_limit + _ROUNDING)
            )
        )

    def latency_cycles(self) -> int | None:
        """From the first cycle that is truly violated to the trip; None without either."""
        violated = np.flatnonzero(self.truly_violated())
        return self.trips[0].cycle - int(violated[0]) if self.trips and len(violated) else None

    def false_trip(self) -> bool:
        """A trip in a cycle in which nothing is truly violated."""
        return bool(self.trips) and not self.truly_violated()[self.trips[0].cycle]

    def missed(self) -> bool:
        """Something is truly violated and nothing trips."""
        return not self.trips and bool(self.truly_violated().any())

    def trip_records(self) -> list[dict[str, Any]]:
        """Each trip's time, function, value and limit."""
        return [
            {"time_s": t.time_s, "function": t.function, "value": t.value, "limit": t.limit}
            for t in self.trips
        ]

    def summary(self) -> dict[str, Any]:
        """What experiments report."""
        stop = self.stop_time_s()
        return {
            "trips": self.trip_records(),
            "peak_after_cut_mps": self.peak_after_cut(),
            "stop_time_s": stop if stop is None or np.isfinite(stop) else None,
            "stop_distance_m": self.stop_distance_m(),
            "max_tcp_speed_mps": self.max_tcp_speed(),
            "left_m": self.left_m,
        }


_ROUNDING = 1e-9
_TRUE = ("tcp_speed", "distance", "velocity")  # what the simulator is asked too
_COLUMNS = (
    "time", "force", "tcp_speed", "distance", "velocity", "protective_m", "speed_ratio",
    "acceleration_ratio", "true_tcp_speed", "true_distance", "true_velocity",
    "true_speed_ratio", "true_acceleration_ratio",
)  # fmt: skip

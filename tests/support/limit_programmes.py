"""Random inputs of the limit stage: ordinary, badly scaled, pinched and contradictory ones."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

import proxcgal as px
from proxcgal import _core

Array = NDArray[np.float64]

PERIOD = 0.01  # [s]
SHAPES = ("ordinary", "badly scaled", "pinched", "contradictory")
DELAYS = ("joint_state_age", "dead_time", "lag", "scan_latency")
CAP_FIELDS = ("caps", "cap_distance", "cap_near", "cap_speed")
ROW_FIELDS = ("rows", "distance", "d_min", "gain", "obstacle_rate")


@dataclass(frozen=True)
class Programme:
    """One input of the stage; rows (k, n), all else of them (k,)."""

    shape: str
    delays: dict[str, float]  # [s] of the arm and the loop
    q_max: Array  # q_min = -q_max
    qd_max: Array
    qdd_max: Array
    q: Array
    qd_last: Array
    elapsed: float
    nominal: Array
    tasks: list[tuple[Array, Array]]  # jacobian, activation
    caps: Array
    cap_distance: Array
    cap_near: Array
    cap_speed: Array
    rows: Array
    distance: Array
    d_min: Array
    gain: Array
    obstacle_rate: Array

    @property
    def config(self) -> px.LimitConfig:
        return px.LimitConfig(**self.delays)

    def by_stage(self) -> _core.LimitedVelocity:
        """Answer of the stage, which was never pinched before."""
        return self.limiter().limit(
            self.q,
            self.qd_last,
            self.elapsed,
            self.nominal,
            [px.Task(J, np.zeros(len(J)), a) for J, a in self.tasks],
            [
                _core.ApproachCap(row, distance=d, near=near, speed=speed)
                for row, d, near, speed in zip(
                    self.caps, self.cap_distance, self.cap_near, self.cap_speed, strict=True
                )
            ],
            [
                _core.RetreatRow(row, distance=d, d_min=d_min, gain=gain, obstacle_rate=rate)
                for row, d, d_min, gain, rate in zip(
                    self.rows, self.distance, self.d_min, self.gain, self.obstacle_rate, strict=True
                )
            ],
        )

    def keep(self, nominal: Array, caps: Array, rows: Array) -> "Programme":
        """The same with this nominal, and only some of its caps and retreat rows."""
        chosen = {name: getattr(self, name)[caps] for name in CAP_FIELDS}
        chosen |= {name: getattr(self, name)[rows] for name in ROW_FIELDS}
        return replace(self, nominal=nominal, **chosen)

    def limiter(self) -> _core.Limiter:
        return _core.Limiter(
            -self.q_max, self.q_max, self.qd_max, self.qdd_max, self.config, PERIOD
        )


def draw(rng: np.random.Generator, shape: str) -> Programme:
    """2 to 12 joints, up to 3 tasks, 24 caps and 16 retreat rows."""
    n = int(rng.integers(2, 13))
    n_caps, n_rows = int(rng.integers(0, 25)), int(rng.integers(0, 17))

    def rows(count: int) -> Array:
        out = rng.uniform(-1, 1, (count, n)) * (rng.random((count, n)) < 0.7)  # joints beyond: 0
        scale = 10.0 ** rng.uniform(-4, 2, (count, 1)) if shape == "badly scaled" else 1.0
        return out * scale

    retreat = rows(n_rows)
    if shape == "pinched":  # each second row against the one before it, some of them shorter
        opposite = -retreat[0 : n_rows - n_rows % 2 : 2]
        retreat[1::2] = opposite * rng.choice([1.0, rng.uniform(0.5, 1.0)], (len(opposite), 1))
    q_max = rng.uniform(1.0, 3.0, n)
    far = 0.05 if shape == "contradictory" else 0.25
    delays = rng.choice([0.0, 0.02], 4) if rng.random() < 0.25 else np.zeros(4)
    return Programme(
        shape=shape,
        delays=dict(zip(DELAYS, delays.tolist(), strict=True)),
        q_max=q_max,
        qd_max=rng.uniform(0.5, 3.0, n),
        qdd_max=rng.uniform(2.0, 20.0, n),
        q=q_max * rng.uniform(-1.002, 1.002, n),
        qd_last=rng.uniform(-0.4, 0.4, n),
        elapsed=rng.uniform(0.005, 0.05),
        nominal=rng.uniform(-1, 1, n) * rng.choice([0.5, 3.0]),
        tasks=[
            (rng.uniform(-1, 1, (m, n)), np.full(m, rng.uniform()))
            for m in rng.integers(1, 7, rng.integers(0, 4))
        ],
        caps=rows(n_caps),
        cap_distance=rng.uniform(0.0, 0.4, n_caps),
        cap_near=rng.choice([0.0, 0.1], n_caps),
        cap_speed=rng.choice([0.2, np.inf], n_caps),
        rows=retreat,
        distance=rng.uniform(-0.02, far, n_rows),
        d_min=rng.uniform(0.1, 0.25, n_rows),
        gain=rng.uniform(1.0, 4.0, n_rows),
        obstacle_rate=rng.uniform(-0.3, 0.3, n_rows),
    )

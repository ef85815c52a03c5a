"""What was taught, made fit to be played: resampled, smoothed within a tolerance, exported."""

import csv
import io
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from proxcgal.core.errors import ConfigError
from proxcgal.core.transforms import nearest_quaternion
from proxcgal.core.typing import Array
from proxcgal.models.robots import Robot

_REST = 1e-3  # [rad/s] of every joint: slower at the ends is waiting
_KEPT = 0.1  # [s] of waiting that is kept at each end
_WIDEST = 0.10  # [s] of the smoothing window's standard deviation, at most
_HALVINGS = 12


@dataclass(frozen=True, eq=False)
class TaughtPath:
    """A cleaned path: m samples, evenly spaced, and what it was made from."""

    time: Array  #: (m,) [s] from 0
    q: Array  #: (m, n_q) [rad]
    raw_time: Array  #: (r,) [s] of the poses as recorded, on the same clock
    raw_tool_W: Array  #: (r, 3) [m] of the tool as recorded
    window_s: float  #: standard deviation of the smoothing window [s]
    deviation_m: float  #: how far cleaning moved the tool, at most

    @property
    def duration(self) -> float:
        """Of the whole path, as recorded [s]."""
        return float(self.time[-1])

    def at(self, time: Array) -> tuple[Array, Array]:
        """Joint positions and velocities (k, n_q) at times [s], by cubic pieces; held outside."""
        step = self.time[1] - self.time[0]
        slope = np.gradient(self.q, step, axis=0)
        slope[[0, -1]] = 0.0  # from rest to rest
        inside = np.clip(time, 0.0, self.duration)
        row = np.minimum((inside / step).astype(np.intp), len(self.time) - 2)
        u = ((inside - self.time[row]) / step)[:, None]
        a, b = self.q[row], self.q[row + 1]
        va, vb = step * slope[row], step * slope[row + 1]
        q = a + u * (va + u * ((3 * (b - a) - 2 * va - vb) + u * (2 * (a - b) + va + vb)))
        qd = (va + u * (2 * (3 * (b - a) - 2 * va - vb) + 3 * u * (2 * (a - b) + va + vb))) / step
        qd[(time < 0.0) | (time > self.duration)] = 0.0
        return q, qd


def clean_path(robot: Robot, time: Array, q: Array, *, step: float, tolerance: float) -> TaughtPath:
    """The widest smoothing that moves the tool nowhere by more than the tolerance.

    Waiting at both ends is cut to 0.1 s; a Gaussian window runs over the joints' positions, ends
    kept; the result is sampled anew. What it moved is measured on the whole: smoothed, sampled and
    put together again by cubic pieces.

    Args:
        robot: whose path it is.
        time: (n,) [s] of the recorded poses, evenly spaced.
        q: (n, n_q) [rad].
        step: [s] between the samples of the result.
        tolerance: [m] of the tool.

    Raises:
        ConfigError: nothing moves in it, or the tolerance cannot be met at this step.
    """
    moving = np.flatnonzero(np.abs(np.gradient(q, time, axis=0)).max(axis=1) > _REST)
    if len(moving) < 2:
        raise ConfigError("taught path: nothing moves in it")
    period = float(time[1] - time[0])
    wait = round(_KEPT / period)
    first, last = max(moving[0] - wait, 0), min(moving[-1] + wait + 1, len(q))
    raw_q, raw_time = q[first:last], time[first:last] - time[first]
    raw_tool = tool_positions(robot, raw_q)
    samples = np.asarray(step * np.arange(int(np.ceil(raw_time[-1] / step)) + 1, dtype=np.float64))

    def made(window: float) -> TaughtPath:
        smooth = sampled(raw_time, _smoothed(raw_q, window / period), samples)
        path = TaughtPath(samples, smooth, raw_time, raw_tool, window, 0.0)
        moved = tool_positions(robot, path.at(raw_time)[0]) - raw_tool
        return replace(path, deviation_m=float(np.linalg.norm(moved, axis=1).max()))

    best = made(0.0)
    if best.deviation_m > tolerance:
        raise ConfigError(
            f"playback.step = {step:g} s alone moves the tool by {1000 * best.deviation_m:.2f} mm; "
            f"playback.tolerance = {1000 * tolerance:g} mm"
        )
    low, high = 0.0, _WIDEST
    for _ in range(_HALVINGS):
        found = made(0.5 * (low + high))
        if found.deviation_m <= tolerance:
            low, best = found.window_s, found
        else:
            high = found.window_s
    return best


def tool_positions(robot: Robot, q: Array) -> Array:
    """(n, 3) of the tool's origin [m] at (n, n_q) postures."""
    return np.array([robot.tool_pose(row)[:3, 3] for row in q]).reshape(-1, 3)


def to_csv(robot: Robot, path: TaughtPath) -> str:
    """The path as a table: time, joints, position and orientation (x, y, z, w) of the tool."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    names = [f"{name}_rad" for name in robot.joint_names]
    table.writerow(["time_s", *names, "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"])
    for time, q in zip(path.time, path.q, strict=True):
        T = np.array(robot.tool_pose(q))
        row = [time, *q, *T[:3, 3], *nearest_quaternion(T[:3, :3])]
        table.writerow([f"{value:.9g}" for value in row])
    return text.getvalue()


def to_trajectory(robot: Robot, path: TaughtPath) -> dict[str, Any]:
    """The path as a plain joint trajectory: names, and points with time, positions, velocities."""
    q, qd = path.at(path.time)
    return {
        "robot": robot.name,
        "joint_names": list(robot.joint_names),
        "points": [
            {"time_from_start_s": float(t), "positions_rad": a.tolist(), "velocities_radps": b}
            for t, a, b in zip(path.time, q, qd.tolist(), strict=True)
        ],
    }


def needed_scale(path: TaughtPath, ratios: Callable[[Array, Array], tuple[float, float]]) -> float:
    """The least factor of the recorded timing that keeps speeds and accelerations in bounds.

    Args:
        path: to be timed.
        ratios: of (q, qd) on the 1 ms grid: largest share of the speed and of the acceleration
            bounds that the recorded timing takes.
    """
    speed, acceleration = ratios(*path.at(path.raw_time))
    return max(speed, math.sqrt(acceleration))


def _smoothed(q: Array, sigma: float) -> Array:
    """A Gaussian window of that many samples; both ends stay where they are."""
    if sigma < 0.5:
        return q
    half = min(int(np.ceil(4 * sigma)), len(q) - 1)
    window = np.exp(-0.5 * (np.arange(-half, half + 1) / sigma) ** 2)
    window /= window.sum()
    before = 2 * q[0] - q[half:0:-1]
    after = 2 * q[-1] - q[-2 : -half - 2 : -1]
    long = np.concatenate([before, q, after])
    return np.stack([np.convolve(column, window, "valid") for column in long.T], axis=1)


def sampled(time: Array, values: Array, samples: Array) -> Array:
    """(k, m) of values (n, m) known at times (n,), linearly, at other times (k,) [s]."""
    return np.stack([np.interp(samples, time, column) for column in values.T], axis=1)

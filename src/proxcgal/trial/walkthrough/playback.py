"""Playing back what was taught: to its start, a check that it is there, then the path, guarded."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from proxcgal.core.errors import ConfigError
from proxcgal.core.typing import Array
from proxcgal.models.robots import Robot
from proxcgal.trial.walkthrough.guarded_arm import GuardedArm
from proxcgal.trial.walkthrough.log import WalkLog
from proxcgal.trial.walkthrough.setup import PERIOD, WalkSetup
from proxcgal.trial.walkthrough.taught_path import (
    TaughtPath,
    needed_scale,
    sampled,
    tool_positions,
)

_RESET_AT, _BEGIN = 0.01, 0.10  # [s] the button, the first motion
_SETTLE = 0.4  # [s] at the start and at the end of the path
_APPROACH_SHARE = 0.4  # of the guard's joint bounds that the way to the start uses
_PULL = 5.0  # [1/s] by which what is left to the path's first pose goes


@dataclass(frozen=True, eq=False)
class PlaybackResult:
    """One playback."""

    log: WalkLog
    scale: float  #: of the recorded timing, as played
    error_m: Array  #: (k,) of the tool from where it was taught, at the same place of the path
    time_s: float  #: of the path alone


def play(setup: WalkSetup, path: TaughtPath, q: Array | None = None) -> PlaybackResult:
    """Runs a taught path from wherever the arm stands; the guard is active throughout.

    Args:
        setup: of the scenario.
        path: cleaned.
        q: (n_q,) where the arm stands; left out: at the path's end, where it was let go.

    Raises:
        ConfigError: the arm is not at the path's start when it is to begin.
        SimulationError: MuJoCo warned.
    """
    keys = setup.scenario.playback
    scale = max(keys.scale, needed_scale(path, _ratios(setup, keys.margin)))
    q = np.array(path.q[-1] if q is None else q)
    approach = _approach(setup, q, path.q[0])
    run = round((scale * path.duration + _SETTLE) / PERIOD)
    begin = round(_BEGIN / PERIOD)
    start = begin + len(approach) + round(_SETTLE / PERIOD)
    path_time: Array = np.arange(run, dtype=np.float64) * PERIOD / scale
    wanted, speeds = path.at(path_time)
    speeds /= scale
    arm = GuardedArm(setup, q)
    physics, bounds = arm.physics, arm.bounds
    log = WalkLog.empty(start + run, setup.robot.n_q, PERIOD, setup.scenario.guard)
    still, sent = np.zeros_like(q), q.copy()
    for k in range(start + run):
        time = k * PERIOD
        out = arm.watch(time, time >= _RESET_AT)
        log.add(time, physics, out, None, None, bounds)
        if k == start and not log.trips:
            check_start(setup.robot, physics.q, path, keys.start_tolerance)
        command = still
        if not out.torque:
            sent[:] = physics.q
        elif begin <= k < begin + len(approach):
            command = approach[k - begin]
        elif k >= start:
            row = k - start
            command = speeds[row] + _PULL * (wanted[row] - sent)
        sent += PERIOD * command
        arm.drive(command)
    log.cut()
    played = log.tool_W[start : start + run]
    inside = path_time <= path.duration
    taught = sampled(path.raw_time, path.raw_tool_W, path_time)
    error = np.linalg.norm(played - taught, axis=1)[inside]
    return PlaybackResult(log, scale, error, scale * path.duration)


def check_start(robot: Robot, q: Array, path: TaughtPath, tolerance: float) -> None:
    """Is the arm where the path begins?

    Raises:
        ConfigError: its tool is farther off than the tolerance [m].
    """
    here, there = tool_positions(robot, np.stack([q, path.q[0]]))
    apart = float(np.linalg.norm(here - there))
    if apart > tolerance:
        raise ConfigError(
            f"playback: the tool is {1000 * apart:.1f} mm from the path's start; "
            f"playback.start_tolerance = {1000 * tolerance:g} mm"
        )


def _ratios(setup: WalkSetup, margin: float) -> Callable[[Array, Array], tuple[float, float]]:
    """How much of the guard's bounds, times the margin, motions take."""
    guard = setup.bounds
    qd_bounds, qdd_bounds = np.array(guard.qd_bounds), np.array(guard.qdd_bounds)
    most = min(setup.scenario.guard.tcp_speed, setup.scenario.guard.max_velocity)

    def of(q: Array, qd: Array) -> tuple[float, float]:
        tool = np.diff(tool_positions(setup.robot, q), axis=0) / PERIOD
        speed = max(
            float((np.abs(qd) / qd_bounds).max()),
            float(np.linalg.norm(tool, axis=1).max() / most),
        )
        qdd = np.diff(qd, axis=0) / PERIOD
        return speed / margin, float((np.abs(qdd) / qdd_bounds).max()) / margin

    return of


def _approach(setup: WalkSetup, here: Array, there: Array) -> Array:
    """(k, n_q) velocities that bring the joints straight to the path's start, slowly."""
    way = there - here
    if not np.any(way):
        return np.empty((0, len(way)))
    share = np.linspace(0.0, 1.0, 101)
    tool = tool_positions(setup.robot, here + share[:, None] * way)
    fastest = float(np.linalg.norm(np.diff(tool, axis=0), axis=1).max()) * 100.0
    guard, speed = setup.bounds, setup.scenario.playback.approach_speed
    # A quintic's greatest rate is 1.875 per duration, its greatest second derivative 5.774.
    duration = max(
        1.875 * fastest / min(speed, setup.scenario.guard.tcp_speed),
        1.875 * float((np.abs(way) / (_APPROACH_SHARE * np.array(guard.qd_bounds))).max()),
        np.sqrt(
            5.774 * float((np.abs(way) / (_APPROACH_SHARE * np.array(guard.qdd_bounds))).max())
        ),
    )
    cycles = int(np.ceil(duration / PERIOD))
    edges = np.linspace(0.0, 1.0, cycles + 1)
    done = edges**3 * (10.0 - 15.0 * edges + 6.0 * edges**2)
    return np.asarray(np.diff(done)[:, None] * way / PERIOD)

"""A whole walk-through: taught, recorded, cleaned, played back; stops looked at more closely."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from proxcgal.core.errors import RecordingError
from proxcgal.trial.walkthrough.log import WalkLog
from proxcgal.trial.walkthrough.playback import PlaybackResult, play
from proxcgal.trial.walkthrough.pose_recording import PoseRecorder, read_poses
from proxcgal.trial.walkthrough.setup import PERIOD, WalkSetup
from proxcgal.trial.walkthrough.stopping_performance import (
    StoppingPerformance,
    stops_with_other_brakes,
    worst_case_problem,
    worst_case_stops,
)
from proxcgal.trial.walkthrough.taught_path import TaughtPath, clean_path
from proxcgal.trial.walkthrough.teaching import START_AT, check_duration, teach


@dataclass(frozen=True, eq=False)
class WalkResult:
    """What one walk-through gave."""

    log: WalkLog
    path: TaughtPath | None = None  #: where it was taught to the end
    played: PlaybackResult | None = None
    slow: WalkLog | None = None  #: the same path taught under the hand-guiding rules
    stops: list[StoppingPerformance] = field(default_factory=list)
    stops_note: str | None = None  #: why those in the worst posture were left out

    def summary(self) -> dict[str, Any]:
        """The numbers of `summary.json`; what does not apply is None."""
        played, error = self.played, None if self.played is None else self.played.error_m
        found = self.log.summary()
        found["playback_error_m"] = {
            "max": None if error is None else float(error.max()),
            "rms": None if error is None else float(np.sqrt((error**2).mean())),
        }
        found["playback"] = None if played is None or self.path is None else {
            "scale": played.scale, "time_s": played.time_s,
            "cleaned_by_m": self.path.deviation_m, "trips": played.log.trip_records(),
        }  # fmt: skip
        found["teaching_time_s"] = None if self.path is None else self.path.duration
        found["hand_guiding"] = None if self.slow is None else {
            "teaching_time_s": _duration(self.slow), "trips": len(self.slow.trips),
            "max_tcp_speed_mps": self.slow.max_tcp_speed(), "left_m": self.slow.left_m,
        }  # fmt: skip
        found["latency_cycles"] = self.log.latency_cycles()
        found["false_trip"], found["missed"] = self.log.false_trip(), self.log.missed()
        found["overrun"] = self.log.overrun
        found["stops"] = [
            {"case": s.case, "brake_scale": s.brake_scale, "stop_distance_m": s.stop_distance_m,
             "stop_time_s": s.stop_time_s if np.isfinite(s.stop_time_s) else None}
            for s in self.stops
        ]  # fmt: skip
        found["stops_note"] = self.stops_note
        return found


def run_walk(
    setup: WalkSetup,
    *,
    seed: int,
    recording: Path,
    on_progress: Callable[[float], None] | None = None,
) -> WalkResult:
    """Teaches, and plays back what the recording holds; or looks at the stop, where there was one.

    Args:
        setup: of the scenario.
        seed: fixes the operator's tremor.
        recording: gets every pose of the teaching.
        on_progress: gets the share of the teaching that is done.

    Raises:
        ConfigError: what does not fit, or a recording that cannot be written.
        RecordingError: the recording stopped before the path's end: part of a path is not played.
        SimulationError: MuJoCo warned.
    """
    check_duration(setup.scenario)
    about = {"scenario": setup.scenario.to_toml(), "seed": str(seed)}
    with PoseRecorder(recording, about) as recorder:
        log = teach(setup, seed=seed, recorder=recorder, with_truth=True, on_progress=on_progress)
    if log.trips:
        stops = stops_with_other_brakes(setup, seed) + worst_case_stops(setup)
        return WalkResult(log, stops=stops, stops_note=worst_case_problem(setup))
    if recorder.failure is not None:
        raise RecordingError(f"{recorder.failure}; what it holds is not the whole path")
    poses = read_poses(recording)
    keys = setup.scenario.playback
    path = clean_path(setup.robot, poses.time, poses.q, step=keys.step, tolerance=keys.tolerance)
    slow = teach(setup.slow(), seed=seed)
    return WalkResult(log, path, play(setup, path), slow)


def _duration(log: WalkLog) -> float:
    """From the signal to start until nothing moves any more [s]."""
    moving = np.flatnonzero(np.abs(log.qd).max(axis=1) > log.rest_speed)
    return float(moving[-1] * PERIOD - START_AT) if len(moving) else 0.0

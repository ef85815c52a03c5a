"""One trial, in whichever process: the robot loaded once, the run measured or recorded."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from proxcgal.core.errors import ConfigError, ModelWarning
from proxcgal.core.progress import OnProgress, ProgressBar
from proxcgal.evaluation.trial_log import TrialLog
from proxcgal.models.robots import Robot
from proxcgal.recording.writer import RecordedTicks, Recorder
from proxcgal.scenario.scenario import Scenario
from proxcgal.scenario.setup import make_robot
from proxcgal.study.jobs import Job
from proxcgal.study.workers import Pool
from proxcgal.trial.trial import run_trial

_KEPT = 4  # robots, with all that is made of them once
_robots: dict[Any, Robot] = {}


def simulate_trial(
    scenario: Scenario,
    controller: str,
    seed: int,
    report: OnProgress,
    *,
    recording: Path | None = None,
    ticks: RecordedTicks = "all",
    robot_digest: str | None = None,
    without_truth: bool = False,
    coverage: bool = False,
    truth_hz: float | None = None,
) -> TrialLog:
    """Runs a trial in a worker process.

    Args:
        scenario: what to run.
        controller: one of CONTROLLERS.
        seed: instead of the scenario's.
        report: called with the share done.
        recording: where to record to; without, true distances are asked only where they decide.
        ticks: which of them the recording holds.
        robot_digest: of the robot that it must be; left out: any.
        without_truth: no true distances at all, without a recording.
        coverage: log which of the closest points were in view.
        truth_hz: true distances to the scene at least so often, where nothing is recorded.

    Raises:
        ProxError: what of the scenario does not fit, another robot; the simulator warned.
    """
    with warnings.catch_warnings():
        # Warnings of a model were given when the set-up was checked; a recording that stops early
        # is in the log.
        warnings.simplefilter("ignore", ModelWarning)
        warnings.simplefilter("ignore", RuntimeWarning)
        robot = robot_of(scenario, robot_digest)
        if recording is None:
            return run_trial(
                scenario, controller, seed=seed, robot=robot, on_progress=report,
                sparse_truth=True, without_truth=without_truth, coverage=coverage,
                truth_hz=truth_hz,
            )  # fmt: skip
        with Recorder(recording, ticks) as recorder:
            log = run_trial(
                scenario, controller, seed=seed, robot=robot, recorder=recorder,
                on_progress=report, coverage=coverage,
            )  # fmt: skip
    return replace(log, recording_failure=recorder.failure)  # closing may have failed too


def robot_of(scenario: Scenario, digest: str | None = None) -> Robot:
    """The scenario's robot, loaded once a process, and again where its files changed since.

    Args:
        scenario: whose robot.
        digest: of the robot that it must be; left out: any.

    Raises:
        ConfigError: it is another robot here.
        ModelError: its description.
    """
    settings = (
        scenario.robot, scenario.package_dirs, scenario.vertices_per_link, scenario.limits
    )  # fmt: skip
    if settings in _robots and digest not in (None, _robots[settings].digest):
        del _robots[settings]  # of an earlier campaign, in a worker that lives on
    if settings not in _robots:
        while len(_robots) >= _KEPT:
            _robots.pop(next(iter(_robots)))
        _robots[settings] = make_robot(scenario)
    robot = _robots[settings]
    if digest not in (None, robot.digest):
        raise ConfigError(
            f"scenario {scenario.name}: robot {scenario.robot} is another one here "
            f"({robot.digest}) than where the campaign was planned ({digest}): its joints, limits "
            "or meshes differ"
        )
    return robot


def simulate_all(
    pool: Pool,
    jobs: Sequence[Job],
    seconds: Sequence[float],
    line: Callable[[int, TrialLog], str],
    *,
    quiet: bool,
) -> list[TrialLog]:
    """Runs recorded trials; warns of recordings that stopped early.

    Args:
        pool: does the work.
        jobs: each returns its trial's log.
        seconds: [s] simulated by each.
        line: what a log file of the progress says of an ended trial, by its row.
        quiet: no progress on stderr.
    """
    with ProgressBar("simulating", seconds, "s", quiet=quiet) as progress:
        logs: list[TrialLog] = pool.run(
            jobs, progress.shares, lambda row, log: progress.finished(line(row, log))
        )
    warn_of_stopped(logs)
    return logs


def warn_of_stopped(logs: Sequence[TrialLog]) -> None:
    """Warns of recordings that stopped early; the workers' own warnings are suppressed."""
    for log in logs:
        if log.recording_failure:
            warnings.warn(log.recording_failure, RuntimeWarning, stacklevel=3)

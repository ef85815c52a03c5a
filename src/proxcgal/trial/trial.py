"""One run, one way through: source -> injected faults -> tick -> recorder."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from proxcgal.core.typing import Array
from proxcgal.evaluation.coverage import coverage_of, sightings
from proxcgal.evaluation.ground_truth import NOT_ASKED, GroundTruth
from proxcgal.evaluation.sparse_ground_truth import sparse_ground_truth
from proxcgal.evaluation.stall_diagnosis import concluded
from proxcgal.evaluation.termination import Ending, GoalWatch
from proxcgal.evaluation.trial_log import TOO_CLOSE, TrialLog, final_ticks, sampled_ticks
from proxcgal.models import Robot
from proxcgal.recording.replay import first_difference, recompute
from proxcgal.recording.trial_recorder import TrialRecorder
from proxcgal.recording.writer import Recorder
from proxcgal.scenario.loading import CONTROLLERS, Scenario
from proxcgal.scenario.setup import Setup
from proxcgal.sim.assembly import Assembly
from proxcgal.sim.tick import Tick, TickTruth
from proxcgal.trial.assembly import assemble

__all__ = ["CONTROLLERS", "TrialLog", "first_difference", "recompute", "run_trial"]

Progress = Callable[[float], None]


def run_trial(
    scenario: Scenario,
    controller: str,
    *,
    seed: int | None = None,
    robot: Robot | None = None,
    recorder: Recorder | None = None,
    on_progress: Progress | None = None,
    sparse_truth: bool = False,
    without_truth: bool = False,
    coverage: bool = False,
    truth_hz: float | None = None,
) -> TrialLog:
    """Simulates a scenario with one controller.

    Args:
        scenario: what to run.
        controller: one of CONTROLLERS.
        seed: instead of the scenario's.
        robot: the scenario's, where it is loaded already.
        recorder: gets every tick; the caller closes it.
        on_progress: gets the share that is done, 0 to 1, once each tenth of a simulated second.
        sparse_truth: true distances only where they can change a number of the summary, which
            stays exact; nan elsewhere. A recording has them at every tick.
        without_truth: none at all, for studies of other things; not for a recording.
        coverage: evaluate what of the closest points was in view.
        truth_hz: with `sparse_truth`, true distances to the scene so often too.

    Raises:
        ConfigError: what of the scenario does not fit; sensors that do not sit where it says.
        SimulationError: the simulator warned.
    """
    begin = clock.perf_counter()
    run = assemble(Setup.of(scenario, robot), controller, seed)
    run.require_mounts()
    sparse = (sparse_truth or without_truth) and recorder is None
    loop = _Loop(run, recorder, on_progress, truth_at_every_tick=not sparse)
    loop.run()
    ending = loop.conclude()
    if sparse and not without_truth:
        loop.ask_sparse_truth(truth_hz or 0.0)
    log = TrialLog.of(
        loop.ticks, run.setup.robot, scenario=scenario.name, controller=controller, seed=run.seed,
        wall_s=clock.perf_counter() - begin, elapsed=loop.elapsed,
        recording_failure=recorder.failure if recorder else None, ending=ending,
    )  # fmt: skip
    return _with_coverage(log, run.setup, np.array(loop.postures)) if coverage else log


class _Loop:
    """Tick after tick of one run, recorded on the way."""

    def __init__(
        self,
        run: Assembly,
        recorder: Recorder | None,
        on_progress: Progress | None,
        *,
        truth_at_every_tick: bool,
    ) -> None:
        setup = run.setup
        self._run, self._on_progress = run, on_progress
        self._truth = GroundTruth(setup.robot, setup.measured) if truth_at_every_tick else None
        self._recorder = None if recorder is None else TrialRecorder(recorder, run)
        finish = setup.scenario.ends()
        self._watch = None if finish is None else GoalWatch(finish, setup.goal)
        self._ending: Ending | None = None
        self._period = run.ctrl.config.period
        self.ticks: list[Tick] = []
        self.postures: list[Array] = []  # where the arm really was: a fault may report another

    @property
    def elapsed(self) -> Array:
        """(n,) [s] of each tick; not the ticks' own time, which a fault may make jump."""
        return np.arange(len(self.ticks), dtype=np.float64) * self._period

    def run(self) -> None:
        """Until the scenario's end, or the goal's."""
        run, scenario = self._run, self._run.setup.scenario
        beat = max(round(0.1 * scenario.simulation.control_hz), 1)
        for inputs, result in run.ticks():
            q, elapsed = run.source.q, len(self.ticks) * self._period
            leaked = 0 if run.known is not None else _leaked(run)
            true = NOT_ASKED if self._truth is None else self._truth(q, elapsed)
            tick = Tick(inputs, result, TickTruth(true.distance, true.link, true.own, leaked))
            self.ticks.append(tick)
            self.postures.append(q)
            if self._recorder is not None:
                self._recorder.write(tick, elapsed, q)
            if self._on_progress is not None and len(self.ticks) % beat == 0:
                self._on_progress(min(len(self.ticks) * self._period / scenario.duration, 1.0))
            if self._watch is not None:
                self._ending = self._watch(elapsed, np.asarray(run.setup.robot.tool_pose(q)))
                if self._ending is not None:
                    break
        if self._on_progress is not None:
            self._on_progress(1.0)

    def conclude(self) -> Ending | None:
        """How the run ended, and what held the arm; None where its scenario has no such end."""
        if self._watch is None:
            return None
        run, last = self._run, (len(self.ticks) - 1) * self._period
        cloud_W = np.asarray(run.ctrl.cloud_W()) if run.known is None else run.known(last)
        ending = self._ending or Ending("aborted", "the time is up")
        return concluded(run.setup, ending, self.ticks[-1].result, self.postures[-1], cloud_W, last)

    def ask_sparse_truth(self, hz: float) -> None:
        """Adds the true distances that decide, of the last ticks, and so many a second."""
        setup, elapsed = self._run.setup, self.elapsed
        asked = sparse_ground_truth(
            setup.robot, setup.measured, elapsed, np.array(self.postures),
            final_ticks(elapsed) | sampled_ticks(elapsed, hz), under=TOO_CLOSE,
        )  # fmt: skip
        columns = zip(self.ticks, asked.distance, asked.link, asked.own, strict=True)
        self.ticks = [
            replace(tick, truth=TickTruth(float(distance), link, float(own), tick.truth.leaked))
            for tick, distance, link, own in columns
        ]


def _leaked(run: Assembly) -> int:
    """How many points of the filtered cloud really are the robot itself."""
    origins = np.asarray(run.ctrl.cloud_origins())[: run.ctrl.seen_points]
    return int(run.source.saw_robot[origins[:, 0], origins[:, 1]].sum())


def _with_coverage(log: TrialLog, setup: Setup, postures: Array) -> TrialLog:
    """The log with what the sensors had in view of the truly closest points."""
    found = replace(log, coverage=coverage_of(setup, postures, log.elapsed))
    if not setup.measured.solids or not len(log.elapsed):
        return found
    moments = (found.nearest_tick, len(log.elapsed) - 1)
    at_nearest, at_end = sightings(setup, postures, log.elapsed, moments)
    return replace(found, sightings=(at_nearest, at_end))

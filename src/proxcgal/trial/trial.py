"""One run, one way through: source -> injected faults -> tick -> recorder."""

import time as clock
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from proxcgal.core.progress import OnProgress
from proxcgal.core.typing import Array, Bools
from proxcgal.evaluation.coverage import coverage_of, sightings
from proxcgal.evaluation.ground_truth import NOT_ASKED, GroundTruth
from proxcgal.evaluation.sparse_ground_truth import sparse_ground_truth
from proxcgal.evaluation.stall_diagnosis import concluded
from proxcgal.evaluation.termination import Ending, GoalWatch
from proxcgal.evaluation.trial_log import TOO_CLOSE, TrialLog, final_ticks, sampled_ticks
from proxcgal.models.robots import Robot
from proxcgal.recording.trial_recorder import TrialRecorder
from proxcgal.recording.writer import Recorder
from proxcgal.scenario.scenario import Scenario
from proxcgal.scenario.setup import Setup
from proxcgal.scenario.walkthrough_scenario import GuidedScenario
from proxcgal.sim.assembly import Assembly
from proxcgal.sim.source import SimulatedSource
from proxcgal.sim.tick import Tick, TickResult, TickTruth
from proxcgal.trial.walkthrough.guided_source import GuidedSource


def assemble(setup: Setup, controller: str, seed: int | None = None) -> Assembly:
    """Makes the controller, its faults, world and source.

    Args:
        setup: of the scenario.
        controller: one of CONTROLLERS.
        seed: instead of the scenario's.

    Raises:
        ConfigError: an unknown controller or sensor, a setting out of bounds.
        SimulationError: MuJoCo refuses the scene.
    """
    guided = isinstance(setup.scenario, GuidedScenario)
    return Assembly.of(setup, controller, seed, GuidedSource if guided else SimulatedSource)


def run_trial(
    scenario: Scenario,
    controller: str,
    *,
    seed: int | None = None,
    robot: Robot | None = None,
    recorder: Recorder | None = None,
    on_progress: OnProgress | None = None,
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
    setup = run.setup
    run.require_mounts()
    sparse = (sparse_truth or without_truth) and recorder is None
    truth = None if sparse else GroundTruth(setup.robot, setup.measured)
    ticks, postures, ending = _simulate(run, truth, recorder, on_progress or (lambda _: None))
    # Not the ticks' own time, which a fault may make jump.
    elapsed = np.arange(len(ticks), dtype=np.float64) * run.ctrl.config.period
    ending = _conclude(run, ending, ticks[-1].result, postures[-1], float(elapsed[-1]))
    if sparse and not without_truth:
        wanted = final_ticks(elapsed) | sampled_ticks(elapsed, truth_hz or 0.0)
        ticks = _with_truth(ticks, elapsed, postures, setup, wanted)
    log = TrialLog.of(
        ticks, setup.robot, scenario=scenario.name, controller=controller, seed=run.seed,
        wall_s=clock.perf_counter() - begin, elapsed=elapsed,
        recording_failure=recorder.failure if recorder else None, ending=ending,
    )  # fmt: skip
    return _with_coverage(log, setup, postures) if coverage else log


def _simulate(
    run: Assembly, truth: GroundTruth | None, recorder: Recorder | None, on_progress: OnProgress
) -> tuple[list[Tick], Array, Ending | None]:
    """Tick after tick until the scenario's end, or the goal's; recorded on the way.

    Returns:
        The ticks; (n, n_q) where the arm really was, whatever a fault reports; how it ended, None
        where its time is up.
    """
    scenario, period = run.setup.scenario, run.ctrl.config.period
    record = None if recorder is None else TrialRecorder(recorder, run)
    finish = scenario.ends()
    watch = None if finish is None else GoalWatch(finish, run.setup.goal)
    beat = max(round(0.1 * scenario.simulation.control_hz), 1)
    ending = None
    ticks: list[Tick] = []
    postures: list[Array] = []
    for inputs, result in run.ticks():
        q, elapsed = run.source.q, len(ticks) * period
        leaked = 0 if run.known is not None else _leaked(run)
        true = NOT_ASKED if truth is None else truth(q, elapsed)
        ticks.append(Tick(inputs, result, TickTruth(true.distance, true.link, true.own, leaked)))
        postures.append(q)
        if record is not None:
            record.write(ticks[-1], elapsed, q)
        if len(ticks) % beat == 0:
            on_progress(min(len(ticks) * period / scenario.duration, 1.0))
        if watch is not None:
            ending = watch(elapsed, np.asarray(run.setup.robot.tool_pose(q)))
            if ending is not None:
                break
    on_progress(1.0)
    return ticks, np.array(postures), ending


def _conclude(
    run: Assembly, ending: Ending | None, last: TickResult, q: Array, time: float
) -> Ending | None:
    """How the run ended, and what held the arm; None where its scenario has no such end."""
    if run.setup.scenario.ends() is None:
        return None
    cloud_W = np.asarray(run.ctrl.cloud_W()) if run.known is None else run.known(time)
    ending = ending or Ending("aborted", "the time is up")
    return concluded(run.setup, ending, last, q, cloud_W, time)


def _with_truth(
    ticks: Sequence[Tick], elapsed: Array, q: Array, setup: Setup, wanted: Bools
) -> list[Tick]:
    """The ticks with the true distances that are wanted or decide."""
    asked = sparse_ground_truth(setup.robot, setup.measured, elapsed, q, wanted, under=TOO_CLOSE)
    return [
        replace(tick, truth=TickTruth(float(distance), link, float(own), tick.truth.leaked))
        for tick, distance, link, own in zip(
            ticks, asked.distance, asked.link, asked.own, strict=True
        )
    ]


def _with_coverage(log: TrialLog, setup: Setup, q: Array) -> TrialLog:
    """The log with what the sensors had in view of the truly closest points."""
    found = replace(log, coverage=coverage_of(setup, q, log.elapsed))
    if not setup.measured.solids:
        return found
    ticks = (found.nearest_tick, len(log.elapsed) - 1)
    at_nearest, at_end = sightings(setup, q, log.elapsed, ticks)
    return replace(found, sightings=(at_nearest, at_end))


def _leaked(run: Assembly) -> int:
    """How many points of the filtered cloud really are the robot itself."""
    origins = np.asarray(run.ctrl.cloud_origins())[: run.ctrl.seen_points]
    return int(run.source.saw_robot[origins[:, 0], origins[:, 1]].sum())

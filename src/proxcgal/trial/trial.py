"""One run, one way through: source -> injected faults -> tick -> recorder."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from proxcgal import _core
from proxcgal.core.progress import OnProgress
from proxcgal.core.typing import Array, Bools
from proxcgal.evaluation.coverage import coverage_of, sightings
from proxcgal.evaluation.ground_truth import NOT_ASKED, GroundTruth
from proxcgal.evaluation.sparse_ground_truth import sparse_ground_truth
from proxcgal.evaluation.stall_diagnosis import concluded
from proxcgal.evaluation.termination import Ending, GoalWatch
from proxcgal.evaluation.trial_log import TOO_CLOSE, TrialLog, final_ticks, sampled_ticks
from proxcgal.models import Robot
from proxcgal.recording.replay import first_difference, recompute
from proxcgal.recording.writer import Recorder, Settings
from proxcgal.scenario.scenario import CONTROLLERS, Scenario
from proxcgal.scenario.setup import Setup
from proxcgal.sim.faults import FaultInjector
from proxcgal.sim.loop import run_ticks
from proxcgal.sim.mount_faults import require_mounts
from proxcgal.sim.source import SimulatedSource
from proxcgal.sim.tick import Tick, TickTruth
from proxcgal.sim.world import World
from proxcgal.trial.walkthrough.guided import GuidedScenario, GuidedSource

__all__ = ["CONTROLLERS", "TrialLog", "first_difference", "recompute", "run_trial"]


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
        on_progress: told the share that is done, 0 to 1, once each tenth of a simulated second.
        sparse_truth: true distances only where they can change a number of the summary, which
            stays exact; nan elsewhere. A recording has them at every tick.
        without_truth: none at all, for studies of other things; not for a recording.
        coverage: tell what of the closest points was in view.
        truth_hz: with `sparse_truth`, true distances to the scene so often too.

    Raises:
        ConfigError: what of the scenario does not fit; sensors that do not sit where it says.
        SimulationError: the simulator warned.
    """
    begin = clock.perf_counter()
    seed = scenario.seed if seed is None else seed
    setup = Setup.of(scenario, robot)
    known = setup.known_cloud() if setup.uses_known_points(controller) else None
    ctrl = setup.make_controller(controller, 0 if known is None else len(known))
    faults = FaultInjector(scenario.faults, [mount.name for mount in setup.skin.mounts], seed)
    world = World(setup.robot, setup.scene) if known is None else None
    make = GuidedSource if isinstance(scenario, GuidedScenario) else SimulatedSource
    source = make(setup, world, seed)
    if world is not None and scenario.skin.check_mounts:
        require_mounts(setup, source)
    sparse = (sparse_truth or without_truth) and recorder is None
    truth = None if sparse else GroundTruth(setup.robot, setup.measured)
    log = None
    if recorder is not None:
        recorder.start(
            Settings(
                scenario=scenario.model_copy(update={"seed": seed}), controller=controller,
                seed=seed, meshes=setup.mesh_hashes(),
                known_points_W=known(0.0) if known is not None and known.still else None,
                ticks=recorder.ticks,
            )
        )  # fmt: skip
        log = _Log(recorder, setup, scenario.simulation.sensor_hz)
    finish = scenario.ends()
    watch = None if finish is None else GoalWatch(finish, setup.goal)
    ending = None
    ticks: list[Tick] = []
    reached: list[Array] = []  # where the arm really was: a fault may tell the controller otherwise
    period = ctrl.config.period
    beat = max(round(0.1 * scenario.simulation.control_hz), 1)
    for inputs, result in run_ticks(source, ctrl, faults, known):
        reached.append(source.q)
        leaked = 0 if known is not None else _leaked(ctrl, source)
        true = NOT_ASKED if truth is None else truth(source.q, len(ticks) * period)
        ticks.append(Tick(inputs, result, TickTruth(true.distance, true.link, true.own, leaked)))
        if log is not None:
            log.write(ticks[-1], (len(ticks) - 1) * period, ctrl, reached[-1])
        if on_progress is not None and len(ticks) % beat == 0:
            on_progress(min(len(ticks) * period / scenario.duration, 1.0))
        if watch is not None:
            ending = watch((len(ticks) - 1) * period, np.asarray(setup.robot.tool_pose(source.q)))
            if ending is not None:
                break
    if on_progress is not None:
        on_progress(1.0)
    if watch is not None:
        last = (len(ticks) - 1) * period
        cloud_W = np.asarray(ctrl.cloud_W()) if known is None else known(last)
        ending = ending or Ending("aborted", "the time is up")
        ending = concluded(setup, ending, ticks[-1].result, reached[-1], cloud_W, last)
    # Not the ticks' own time, which a fault may make jump.
    elapsed = np.arange(len(ticks), dtype=np.float64) * period
    if truth is None and not without_truth:
        wanted = final_ticks(elapsed) | sampled_ticks(elapsed, truth_hz or 0.0)
        ticks = _with_truth(ticks, elapsed, np.array(reached), setup, wanted)
    log_of_run = TrialLog.of(
        ticks, setup.robot, scenario=scenario.name, controller=controller, seed=seed,
        wall_s=clock.perf_counter() - begin, elapsed=elapsed,
        recording_failure=recorder.failure if recorder else None, ending=ending,
    )  # fmt: skip
    if not coverage:
        return log_of_run
    found = replace(log_of_run, coverage=coverage_of(setup, np.array(reached), elapsed))
    if not setup.measured.solids or not ticks:
        return found
    moments = (found.nearest_tick, len(ticks) - 1)
    at_nearest, at_end = sightings(setup, np.array(reached), elapsed, moments)
    return replace(found, sightings=(at_nearest, at_end))


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


def _leaked(ctrl: _core.Controller, source: SimulatedSource) -> int:
    """How many points of the filtered cloud really are the robot itself."""
    origins = np.asarray(ctrl.cloud_origins())[: ctrl.seen_points]
    return int(source.saw_robot[origins[:, 0], origins[:, 1]].sum())


class _Log:
    """What the recorder is told: every tick, and at the sensors' rate what Foxglove draws."""

    def __init__(self, recorder: Recorder, setup: Setup, hz: float) -> None:
        self._recorder = recorder
        self._robot, self._scene = setup.robot, setup.scenario.drawn()
        self._hz = hz
        self._beats = -1

    def write(self, tick: Tick, elapsed: float, ctrl: _core.Controller, q: Array) -> None:
        """One tick; the arm is drawn at `q`, where it is, whatever the controller is told."""
        beats = int(np.floor(elapsed * self._hz + 1e-9))  # those of the scans
        beat = beats > self._beats
        if beat:
            self._beats = beats
            arrow = (tick.result.control_W, tick.result.obstacle_W)
            poses = np.asarray(self._robot.link_poses(q))
            names = self._robot.link_names
            if beats == 0 or not self._scene.still:
                self._recorder.show_scene(tick.inputs.time, self._scene, elapsed)
            self._recorder.show(tick.inputs.time, ctrl.cloud_W(), names, poses, arrow)
        if beat or tick.inputs.scans or self._recorder.ticks == "all":
            self._recorder.write(tick)

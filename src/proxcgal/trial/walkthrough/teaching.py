"""Teaching: the hand pulls, the admittance follows, the guard watches, the arm has weight."""

from collections.abc import Callable

import numpy as np

from proxcgal.core.errors import ConfigError
from proxcgal.scenario.walkthrough_scenario import WalkScenario
from proxcgal.trial.walkthrough.guarded_arm import GuardedArm
from proxcgal.trial.walkthrough.intended_path import IntendedPath
from proxcgal.trial.walkthrough.log import WalkLog
from proxcgal.trial.walkthrough.operator_hand import OperatorHand
from proxcgal.trial.walkthrough.pose_recording import PoseRecorder
from proxcgal.trial.walkthrough.setup import PERIOD, WalkSetup

RESET_AT, ENGAGE_AT, START_AT = 0.05, 0.10, 0.50  # [s] the button, the switch, the signal to start
SETTLE = 0.8  # [s] after the path's end until the hand lets go
AFTER_STOP = 0.6  # [s] that a stop is watched
REACHED = 0.02  # [m] of the tool from where the path ends: farther, it was not taught to its end


def check_duration(scenario: WalkScenario) -> None:
    """Is there time for the intended path, also under the hand-guiding rules?

    Raises:
        ConfigError: it takes longer than `duration`.
    """
    for legs, rules in ((scenario.legs, ""), (scenario.slow().legs, " by the hand-guiding rules")):
        path = PERIOD * len(IntendedPath.of(legs, PERIOD))
        needed = START_AT + path + scenario.hand.reaction_time + 2.0 * SETTLE
        if scenario.duration < needed:
            raise ConfigError(
                f"scenario {scenario.name}: duration = {scenario.duration:g} s: the wished path "
                f"takes {needed:.1f} s to teach{rules}"
            )


def teach(
    setup: WalkSetup,
    *,
    seed: int,
    recorder: PoseRecorder | None = None,
    with_truth: bool = False,
    on_progress: Callable[[float], None] | None = None,
) -> WalkLog:
    """Simulates one teaching until the path's end, or until a trip has stopped the arm.

    Args:
        setup: of the scenario.
        seed: fixes the operator's tremor.
        recorder: gets every pose; the caller closes it.
        with_truth: ask the simulator too, in every cycle, what the guard should find.
        on_progress: gets the share that is done, 0 to 1, every 0.1 s simulated.

    Raises:
        ConfigError: a guard that contradicts itself.
        SimulationError: MuJoCo warned.
    """
    scenario = setup.scenario
    arm = GuardedArm(setup)
    physics, bounds = arm.physics, arm.bounds
    path = IntendedPath.of(scenario.legs, PERIOD)
    start = np.array(setup.robot.tool_pose(setup.q0))
    hand = OperatorHand(scenario.hand, path, start, PERIOD, seed)
    begin = round(START_AT / PERIOD)
    release = begin + hand.cycles + round(SETTLE / PERIOD)
    cycles = min(release + round(SETTLE / PERIOD), round(scenario.duration / PERIOD))
    log = WalkLog.empty(cycles, setup.robot.n_q, PERIOD, scenario.guard)
    force = np.zeros(6)
    last = cycles
    for k in range(cycles):
        time = k * PERIOD
        out = arm.watch(time, time >= RESET_AT)
        truth = physics.truth(setup.monitored_pairs, setup.monitored_ends) if with_truth else None
        engaged = time >= ENGAGE_AT and k < release
        if engaged:
            force = hand.force(k - begin, physics.tool_W, physics.tool_R, physics.tool_twist())
        else:
            force[:] = 0.0
        if out.trips and not out.torque:
            hand.feel_stop()
        log.add(time, physics, out, force, truth, bounds)
        if recorder is not None:
            recorder.write(time, physics.q, physics.tool_W, physics.tool_R, force, out.torque)
        if out.trips and last == cycles:
            last = min(k + round(AFTER_STOP / PERIOD), cycles)
        arm.move(force, engaged)
        if on_progress is not None and k % 100 == 0:
            on_progress(k / cycles)
        if k >= last:
            break
    if on_progress is not None:
        on_progress(1.0)
    if not log.trips:
        log.left_m = float(np.linalg.norm(start[:3, 3] + path.position[-1] - physics.tool_W))
    return log.cut()

"""How the arm stops under other brakes and in the worst posture: simulated, not assumed."""

from dataclasses import dataclass, replace

import numpy as np

from proxcgal.sim.physics import Physics
from proxcgal.trial.walkthrough.setup import PERIOD, WalkSetup
from proxcgal.trial.walkthrough.teaching import teach

BRAKE_SCALES = (0.7, 1.0, 1.3)
WORST_SPEED, WORST_PAYLOAD = 1.30, 5.0  # [m/s] of the tool, downwards; [kg]
#: Stretched level before the arm, gun and all; the second joint brings it down.
STRETCHED = (0.0, np.pi / 2, -1.57, 0.0, 0.0, 0.0)
_SINKING = 1  # row of that joint
_DOWN = 0.9  # of the tool's velocity leads downwards, at least
_RAMP = 0.6  # [s] to that speed
_WATCHED = 3.0  # [s] after the torque is cut


@dataclass(frozen=True, slots=True, kw_only=True)
class StoppingPerformance:
    """Time and distance of one stop."""

    case: str
    brake_scale: float  #: of the arm's own brakes' torques
    stop_time_s: float  #: inf where it did not come to rest while it was watched
    stop_distance_m: float


def stops_with_other_brakes(setup: WalkSetup, seed: int) -> list[StoppingPerformance]:
    """The scenario's own stop with brakes 30 % weaker, as they are and 30 % stronger."""
    stops = []
    for scale in BRAKE_SCALES:
        arm = setup.scenario.arm.model_copy(
            update={"brake_scale": scale * setup.scenario.arm.brake_scale}
        )
        other = replace(setup, scenario=setup.scenario.model_copy(update={"arm": arm}))
        log = teach(other, seed=seed)
        if log.trips:
            time, distance = log.stop_time_s() or 0.0, log.stop_distance_m() or 0.0
            stops.append(
                StoppingPerformance(
                    case="as run", brake_scale=arm.brake_scale, stop_time_s=time,
                    stop_distance_m=distance,
                )
            )  # fmt: skip
    return stops


def worst_case_stops(setup: WalkSetup) -> list[StoppingPerformance]:
    """Stretched level, 5 kg more on the gun, 1.30 m/s downwards, with the same brakes.

    None where there is a `worst_case_problem`.
    """
    return [] if worst_case_problem(setup) else [_worst(setup, scale) for scale in BRAKE_SCALES]


def worst_case_problem(setup: WalkSetup) -> str | None:
    """Why an arm is not looked at in the worst posture, which is that of `ga_ol`; None: it is."""
    robot, q = setup.robot, np.array(STRETCHED)
    text = f"worst posture left out: that of ga_ol does not fit {robot.name}: "
    if robot.n_q != len(q):
        return text + f"{robot.n_q} joints, not {len(q)}"
    outside = np.flatnonzero((q < robot.q_min) | (q > robot.q_max))
    if len(outside):
        names = ", ".join(robot.joint_names[row] for row in outside)
        return text + f"it is beyond the limits of {names}"
    way_W = np.asarray(robot.tool_jacobian(q))[:3, _SINKING]
    if -way_W[2] < _DOWN * np.linalg.norm(way_W) or not way_W.any():
        return text + f"{robot.joint_names[_SINKING]} does not bring the tool down there"
    return None


def _worst(setup: WalkSetup, scale: float) -> StoppingPerformance:
    robot, q = setup.robot, np.array(STRETCHED)
    speed = WORST_SPEED / np.linalg.norm(robot.tool_jacobian(q)[:3, _SINKING])
    q[_SINKING] -= 0.5 * speed * _RAMP  # so that it is level once that fast
    brakes = scale * setup.scenario.arm.brake_scale
    physics = Physics(
        setup.arm, q, period=PERIOD, payload=WORST_PAYLOAD, brake_scale=brakes
    )  # fmt: skip
    command, cycles = np.zeros(robot.n_q), round(_RAMP / PERIOD)
    for k in range(cycles):
        command[_SINKING] = speed * (k + 1) / cycles
        physics.step(command, True)
    for _ in range(round(0.05 / PERIOD)):  # until the drives follow
        physics.step(command, True)
    watched = round(_WATCHED / PERIOD)
    qd, tool = np.empty((watched, robot.n_q)), np.empty((watched, 3))
    for k in range(watched):
        qd[k], tool[k] = physics.qd, physics.tool_W
        physics.step(command, False)
    moving = np.flatnonzero(np.abs(qd).max(axis=1) > setup.scenario.guard.rest_speed)
    last = int(moving[-1]) + 1 if len(moving) else 0
    return StoppingPerformance(
        case="worst posture", brake_scale=brakes,
        stop_time_s=last * PERIOD if last < watched else float("inf"),
        stop_distance_m=float(np.linalg.norm(np.diff(tool, axis=0), axis=1).sum()),
    )  # fmt: skip

"""Random operators and paths: some keep within the guard's bounds, others break one of them."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from proxcgal.core.errors import ConfigError
from proxcgal.scenario.loading import load_scenario
from proxcgal.scenario.walkthrough_scenario import WalkScenario
from proxcgal.study.trial_simulation import robot_of
from proxcgal.trial.walkthrough.intended_path import IntendedPath
from proxcgal.trial.walkthrough.setup import WalkSetup

#: What an operator does, and the scenario that it is drawn round.
BEHAVIOURS = {
    "compliant": "walkthrough_teach",
    "overspeed": "walkthrough_overspeed",
    "too_close": "walkthrough_too_close",
    "closing_fast": "walkthrough_closing_fast",
}
#: The function that each is to trip first; none for the first.
OWN = {"overspeed": "tcp_speed", "too_close": "distance", "closing_fast": "relative_velocity"}

# Uniform. Fixed before any drawn run was made.
HAND = {
    "stiffness": (250.0, 600.0), "damping": (40.0, 90.0), "tremor": (0.5, 3.0),
    "reaction_time": (0.15, 0.35), "max_force": (90.0, 150.0),
}  # fmt: skip
HUMAN = {"radius": (0.17, 0.23), "height": (1.55, 1.95)}
COMPLIANT_SHARE = 0.85  # of each bound, at most, on a compliant path
COMPLIANT_CLEARANCE_M = 0.02  # beyond the minimum distance
_STEP = 0.005  # [s] at which a path is checked
_TRIES = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class WalkDraw:
    """One operator with a path."""

    behaviour: str  # one of BEHAVIOURS
    source: str
    overrides: tuple[str, ...]  # of the source
    scenario: WalkScenario
    redrawn: int  # compliant paths that were not, before this one


def draw_walk(behaviour: str, seed: int, number: int, more: Sequence[str] = ()) -> WalkDraw:
    """The operator of that number: the same for the same behaviour, seed and number.

    A compliant path is drawn again until the arm, following it exactly, keeps within 0.85 of every
    bound on speeds and accelerations and 0.02 m off the minimum distance.

    Args:
        behaviour: one of BEHAVIOURS.
        seed: of the campaign.
        number: of the draw, from 0.
        more: assignments that hold for all draws.

    Raises:
        ConfigError: hardly any draw would do, or an assignment that does not fit.
    """
    generator = np.random.default_rng([seed, list(BEHAVIOURS).index(behaviour), number])
    reasons: Counter[str] = Counter()
    for tries in range(_TRIES):
        legs = _LEGS[behaviour](generator)
        overrides = (
            f"leg=[{', '.join(legs)}]",
            *(f"hand.{k}={generator.uniform(*spread):.4g}" for k, spread in HAND.items()),
            *(f"guard.human.{k}={generator.uniform(*spread):.3f}" for k, spread in HUMAN.items()),
            *more,
        )
        scenario = load_scenario(BEHAVIOURS[behaviour], overrides)
        assert isinstance(scenario, WalkScenario)
        if behaviour != "compliant" or (reason := _beyond(scenario)) is None:
            return WalkDraw(
                behaviour=behaviour, source=BEHAVIOURS[behaviour], overrides=overrides,
                scenario=scenario, redrawn=tries,
            )  # fmt: skip
        reasons[reason] += 1
    counts = ", ".join(f"{reason} {count} times" for reason, count in reasons.most_common())
    raise ConfigError(f"walkthrough: none of {_TRIES} compliant paths will do: {counts}")


def _leg(to: Sequence[float], turn: Sequence[float], **keys: float) -> str:
    values = {"to": _list(to), "turn": _list(turn)}
    values |= {key: f"{value:.4g}" for key, value in keys.items()}
    return "{" + ", ".join(f"{key} = {value}" for key, value in values.items()) + "}"


def _list(values: Sequence[float]) -> str:
    return "[" + ", ".join(f"{value + 0.0:.4f}" for value in values) + "]"


def _compliant(g: np.random.Generator) -> list[str]:
    """Sweeps from side to side at heights, depths and turns of their own."""
    side = g.choice((-1.0, 1.0))
    legs = []
    for _ in range(int(g.integers(3, 6))):
        side = -side
        to = (g.uniform(-0.10, 0.10), side * g.uniform(0.4, 0.75), g.uniform(-0.2, 0.2))
        legs.append(
            _leg(to, g.uniform(-0.15, 0.15, 3).tolist(), speed=g.uniform(0.5, 1.10),
                 ramp=g.uniform(0.8, 1.1), wait=g.uniform(0.0, 0.4))
        )  # fmt: skip
    return legs


def _overspeed(g: np.random.Generator) -> list[str]:
    side, height = g.choice((-1.0, 1.0)), g.uniform(-0.15, 0.15)
    first = (0.0, -side * g.uniform(0.70, 0.80), height)
    second = (0.0, side * g.uniform(0.75, 0.90), height + g.uniform(-0.1, 0.1))
    return [
        _leg(first, (0.0, 0.0, 0.0), speed=g.uniform(0.4, 0.7), ramp=0.9),
        _leg(second, (0.0, 0.0, 0.0), speed=g.uniform(1.50, 1.70), ramp=g.uniform(0.75, 0.90)),
    ]


def _too_close(g: np.random.Generator) -> list[str]:
    to = (g.uniform(-0.1, 0.1), g.uniform(-0.5, 0.5), g.uniform(-0.15, 0.15))
    turn = (0.0, -g.uniform(1.0, 1.3), 0.0)
    return [
        _leg(to, (0.0, 0.0, 0.0), speed=g.uniform(0.3, 0.7), ramp=0.8),
        _leg(to, turn, speed=0.5, turn_speed=g.uniform(0.4, 1.0), ramp=0.8),
    ]


def _closing_fast(g: np.random.Generator) -> list[str]:
    yaw, height = g.uniform(1.1, 1.25), g.uniform(-0.1, 0.1)
    first, second = (0.0, g.uniform(0.10, 0.20), height), (0.0, g.uniform(1.20, 1.30), height)
    turn = (0.0, 0.0, yaw)
    return [
        _leg(first, turn, speed=0.6, turn_speed=g.uniform(0.5, 0.8), ramp=0.9),
        _leg(second, turn, speed=g.uniform(1.52, 1.60), ramp=g.uniform(0.62, 0.66)),
    ]


_LEGS = {
    "compliant": _compliant, "overspeed": _overspeed, "too_close": _too_close,
    "closing_fast": _closing_fast,
}  # fmt: skip


def _beyond(scenario: WalkScenario) -> str | None:
    """Why a path is not compliant; None where it is. The arm is assumed to follow it exactly."""
    setup = WalkSetup.of(scenario, robot_of(scenario))
    robot, keys = setup.robot, scenario.guard
    path = IntendedPath.of(scenario.legs, _STEP)
    bounds = setup.bounds
    q, qd = setup.q0.copy(), np.zeros(robot.n_q)
    guard = setup.make_guard()
    share, clearance = COMPLIANT_SHARE, keys.min_distance + COMPLIANT_CLEARANCE_M
    for row in range(len(path)):
        twist = np.concatenate([path.velocity[row], path.spin[row]])
        before, qd = qd, np.linalg.solve(robot.tool_jacobian(q), twist)
        if (np.abs(qd) > share * np.array(bounds.qd_bounds)).any():
            return "joint speed"
        allowed = setup.scenario.arm.command_share * share * np.array(bounds.qdd_bounds)
        if (np.abs(qd - before) / _STEP > allowed).any():
            return "joint acceleration"
        if np.linalg.norm(twist[:3]) > share * keys.tcp_speed:
            return "tool speed"
        out = guard.cycle(row * _STEP, q, qd)
        if out.distance < clearance:
            return "distance"
        if out.velocity > share * keys.max_velocity:
            return "relative velocity"
        q = q + _STEP * qd
    return None

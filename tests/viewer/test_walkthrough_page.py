"""The walk-through cell behind the page: the run's own cycles, a hand that somebody moves."""

import numpy as np
import pytest

from proxcgal.scenario.loading import load_scenario
from proxcgal.scenario.walkthrough_scenario import WalkScenario
from proxcgal.sim.moment import Moment
from proxcgal.trial.interactive import LiveTrial
from proxcgal.trial.walkthrough.interactive import WalkTrial
from proxcgal.trial.walkthrough.operator_hand import ACCELERATION, HAND, SPEED, InteractiveHand
from proxcgal.trial.walkthrough.setup import PERIOD


@pytest.fixture
def trial() -> WalkTrial:
    scenario = load_scenario("walkthrough_teach")
    assert isinstance(scenario, WalkScenario)
    return WalkTrial(scenario)


def run(trial: WalkTrial | LiveTrial, seconds: float) -> None:
    for _ in range(round(seconds / trial.period)):
        trial.step()


def on(trial: WalkTrial) -> np.ndarray:
    """Switched on: where the tool is."""
    trial.enable()
    run(trial, 0.1)
    assert trial.moment().state == "on"
    hand_W = trial.moment().hand_W
    assert hand_W is not None
    return np.array(hand_W)


def dragged(trial: WalkTrial, T_W: np.ndarray, way: tuple[float, ...], seconds: float) -> None:
    """The hand goes that way, update 20 times a second."""
    steps = max(round(20.0 * seconds), 1)
    for k in range(steps):
        wanted = T_W.copy()
        wanted[:3, 3] += np.array(way) * (k + 1) / steps
        trial.move(HAND, wanted)
        run(trial, seconds / steps)


def tool(trial: WalkTrial) -> np.ndarray:
    return trial.moment().links_W[-1][:3, 3].copy()


def test_torque_is_off_until_somebody_switches_it_on(trial: WalkTrial) -> None:
    before = tool(trial)
    trial.move(HAND, np.eye(4))  # a hand takes hold of an arm with torque only
    run(trial, 0.5)
    moment = trial.moment()
    assert (moment.state, moment.gripped, moment.trips) == ("off", False, 0)
    assert np.allclose(tool(trial), before, atol=1e-3)
    on(trial)


def test_the_tool_follows_a_slow_hand_and_stays_where_it_is_let_go(trial: WalkTrial) -> None:
    T_W = on(trial)
    dragged(trial, T_W, (0.0, 0.3, 0.0), 1.5)
    run(trial, 1.0)
    hand = trial.moment().hand_W
    assert hand is not None
    assert np.allclose(hand[:3, 3] - T_W[:3, 3], [0.0, 0.3, 0.0], atol=0.01)
    trial.release()
    run(trial, 0.5)
    there = tool(trial)
    run(trial, 0.5)
    assert np.allclose(tool(trial), there, atol=1e-3)
    assert (trial.moment().state, trial.moment().gripped) == ("on", False)


def test_a_fast_hand_trips_the_guard_which_stays_so_until_its_button(trial: WalkTrial) -> None:
    T_W = on(trial)
    dragged(trial, T_W, (0.0, -0.8, 0.0), 0.2)
    run(trial, 1.3)
    moment = trial.moment()
    assert moment.trip.startswith("tcp_speed 1.3")
    assert (moment.state, moment.trips, moment.gripped) == ("off", 1, False)
    assert moment.stop_time < 0.35
    stood = tool(trial)
    trial.move(HAND, T_W)
    run(trial, 1.0)
    assert trial.moment().state == "off"
    assert np.allclose(tool(trial), stood, atol=2e-3)
    on(trial)
    assert trial.moment().trips == 1


def test_what_is_still_violated_refuses_the_torque_and_says_so(trial: WalkTrial) -> None:
    T_W = on(trial)
    for angle in np.linspace(0.0, -1.4, 40):
        wanted, c, s = T_W.copy(), np.cos(angle), np.sin(angle)
        wanted[:3, :3] = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]) @ T_W[:3, :3]
        trial.move(HAND, wanted)
        run(trial, 0.05)
    run(trial, 0.8)
    assert trial.moment().trip.startswith("distance 0.45")
    trial.enable()
    run(trial, 0.1)
    assert trial.moment().state == "off"
    assert trial.moment().refused == "still violated: distance"
    again = trial.again()
    assert again.moment().state == "off"  # the start does not switch on either
    on(again)


def test_a_hand_that_leaps_moves_within_its_bounds(trial: WalkTrial) -> None:
    grip = InteractiveHand(trial.setup.scenario.hand, PERIOD)
    wanted = np.eye(4)
    wanted[:3, 3] = 0.9, -0.9, 0.4
    grip.move(np.eye(4), wanted)
    places = []
    for _ in range(2000):
        force = grip.force(np.zeros(3), np.eye(3), np.zeros(6))
        assert np.linalg.norm(force[:3]) <= trial.setup.scenario.hand.max_force + 1e-9
        assert grip.pose is not None
        places.append(grip.pose[:3, 3].copy())
    velocity = np.diff(places, axis=0) / PERIOD
    assert np.linalg.norm(velocity, axis=1).max() <= SPEED + 1e-9
    change = np.linalg.norm(np.diff(velocity, axis=0), axis=1) / PERIOD
    assert change.max() <= ACCELERATION + 1e-6
    assert np.allclose(places[-1], wanted[:3, 3], atol=1e-3)


def test_a_guided_arm_goes_where_the_hand_is_dragged() -> None:
    trial = LiveTrial(load_scenario("walkthrough_bystander"), "wb")
    run(trial, 0.1)
    moment = trial.moment()
    assert isinstance(moment, Moment)
    assert moment.hand_W is not None
    wanted = moment.hand_W.copy()
    wanted[2, 3] += 0.15
    trial.move(HAND, wanted)
    run(trial, 2.0)
    moved = trial.moment()
    assert moved.gripped
    assert moved.hand_W is not None
    here = np.asarray(trial.setup.robot.tool_pose(trial.q))[:3, 3]
    assert here[2] > moment.hand_W[2, 3] + 0.1
    trial.release()
    run(trial, 0.1)
    assert not trial.moment().gripped

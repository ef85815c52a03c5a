"""The live trial behind the page: hands, silent sensors, what a page may choose, how it is told."""

import multiprocessing
import time as clock
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import proxcgal as px
from proxcgal.apps.view.choice import Choice
from proxcgal.apps.view.desk import ROOM, Desk
from proxcgal.apps.view.simulation import Told, Wishes, simulate
from proxcgal.apps.view.stage import Stage
from proxcgal.models.display import display_meshes
from proxcgal.sim.frames import pose
from proxcgal.sim.live import STOP, Hands, LiveScene, LiveTrial
from proxcgal.sim.moment import without
from proxcgal.sim.scenario import Scenario, load_scenario
from proxcgal.sim.trial import run_trial

RNG = np.random.default_rng(1)


@pytest.fixture(scope="module")
def cell(arm_cell: Path) -> Scenario:
    return load_scenario(arm_cell)


@pytest.fixture(scope="module")
def front() -> Scenario:
    return load_scenario("front_plane")


def test_a_live_trial_that_nobody_touches_is_the_trial_itself(front: Scenario) -> None:
    recorded = run_trial(front.model_copy(update={"duration": 0.5}), "wb")
    live = LiveTrial(front, "wb")
    commands = np.array([live.step().qd for _ in recorded.time])
    assert np.array_equal(commands, recorded.qd)
    assert live.moment().true == recorded.true_m[-1]


def test_a_held_solid_goes_where_it_is_wanted_at_bounded_speed() -> None:
    hands, wanted = Hands(speed=0.5), pose((0.3, 0.4, 0.0))
    hands.move("box", np.eye(4), wanted)
    hands.advance(0.1)
    assert np.allclose(hands.held["box"][:3, 3], [0.03, 0.04, 0.0])
    assert np.allclose(hands.velocity("box"), [0.3, 0.4, 0.0])
    for _ in range(20):
        hands.advance(0.1)
    assert np.array_equal(hands.held["box"], wanted)
    assert np.array_equal(hands.velocity("box"), np.zeros(3))


def test_what_nobody_holds_goes_its_own_way(front: Scenario) -> None:
    table = front.obstacles[0].model_dump() | {"name": "cart", "path": ((0.0, 0.827, 0.1742, 0.6),
                                                                        (2.0, 2.827, 0.1742, 0.6))}  # fmt: skip
    moving = front.model_copy(
        update={"obstacles": (*front.obstacles, type(front.obstacles[0])(**table))}
    )
    hands = Hands()
    scene = LiveScene(moving.scene(), hands, since=1.0)
    hands.move("panel", scene.poses(0.0)[0], pose((1.0, 0.0, 0.5)))
    hands.advance(10.0)
    assert np.allclose(scene.poses(0.5)[:, :3, 3], [[1.0, 0.0, 0.5], [2.327, 0.1742, 0.6]])
    assert np.allclose(scene.twists(0.5)[1, :3], [1.0, 0.0, 0.0])
    hands.release()
    assert np.array_equal(scene.poses(0.5), moving.scene().poses(1.5))


def test_an_obstacle_moved_to_the_flange_raises_activation_and_the_arm_goes_away(
    front: Scenario,
) -> None:
    live = LiveTrial(front, "wb")
    for _ in range(300):
        live.step()
    before = live.moment()
    tool = np.asarray(live.setup.robot.tool_pose(live.q))[:3, 3]
    live.move("panel", pose((0.6, 0.1742, 0.6)))
    highest = max(live.step().activation() for _ in range(60))
    for _ in range(200):
        live.step()
    assert highest > before.activation + 0.2
    assert np.asarray(live.setup.robot.tool_pose(live.q))[0, 3] < tool[0] - 0.1
    assert live.moment().true > 0.05


def test_a_silent_sensor_is_missed_by_the_cloud_and_by_the_monitor(front: Scenario) -> None:
    live = LiveTrial(front, "wb")
    for _ in range(100):
        live.step()
    seeing = {int(row) for row in live.law.cloud_origins()[:, 0]}
    assert seeing
    live.off = frozenset(seeing)
    for _ in range(30):
        result = live.step()
    assert not seeing & {int(row) for row in live.law.cloud_origins()[:, 0]}
    assert result.mode > 0


def test_nothing_that_a_page_says_leads_out_of_a_stop(cell: Scenario) -> None:
    link, process = started(cell)
    try:
        speak(link, Wishes(running=False))
        stopping = cell.model_copy(update={"faults": (_broken_joints(),)})
        assert stopping
    finally:
        link.close()
        process.join(5.0)


def _broken_joints() -> object:
    from proxcgal.sim.scenario_keys import Fault

    return Fault(**{"kind": "joints_old", "value": 1.0, "from": 0.1, "to": 0.3})


def started(scenario: Scenario, controller: str = "wb"):  # type: ignore[no-untyped-def]
    """A simulation in its process, and the link to it."""
    context = multiprocessing.get_context("spawn")
    link, theirs = context.Pipe()
    process = context.Process(target=simulate, args=(theirs, scenario, controller), daemon=True)
    process.start()
    theirs.close()
    return link, process


def listen(link, until, seconds: float = 30.0) -> Told:  # type: ignore[no-untyped-def]
    """Takes what is told until that is true of it."""
    end = clock.monotonic() + seconds
    while clock.monotonic() < end:
        if link.poll(0.1):
            told: Told = link.recv()
            assert not told.failed, told.failed
            if told.moment is not None:
                link.send(None)
            if until(told):
                return told
    raise AssertionError("nothing of the kind was told in time")


def speak(link, wishes: Wishes) -> None:  # type: ignore[no-untyped-def]
    link.send(wishes)

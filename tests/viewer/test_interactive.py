"""The live trial behind the page: hands, silent sensors, what a page may choose, its updates."""

import multiprocessing
import re
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import proxcgal as px
from proxcgal.core.modes import DEGRADED, HOLD, STOP
from proxcgal.core.transforms import pose
from proxcgal.models.mesh.display import display_meshes
from proxcgal.scenario.fault_keys import Fault
from proxcgal.scenario.loading import load_scenario
from proxcgal.scenario.scenario import Scenario
from proxcgal.scene.dragging import DraggedSolids, LiveScene
from proxcgal.sim.clouds import without
from proxcgal.trial.interactive import LiveTrial
from proxcgal.trial.trial import run_trial
from proxcgal.viewer.choice import Choice, robots
from proxcgal.viewer.command_queue import ROOM, CommandQueue
from proxcgal.viewer.live_page import Preparation
from proxcgal.viewer.messages import Request, Update
from proxcgal.viewer.simulation import run_simulation

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
    hands, wanted = DraggedSolids(speed=0.5), pose((0.3, 0.4, 0.0))
    hands.move("box", np.eye(4), wanted)
    hands.advance(0.1)
    assert np.allclose(hands.held["box"][:3, 3], [0.03, 0.04, 0.0])
    assert np.allclose(hands.velocity("box"), [0.3, 0.4, 0.0])
    for _ in range(20):
        hands.advance(0.1)
    assert np.array_equal(hands.held["box"], wanted)
    assert np.array_equal(hands.velocity("box"), np.zeros(3))


def test_what_nobody_holds_goes_its_own_way(front: Scenario) -> None:
    path = ((0.0, 0.827, 0.1742, 0.6), (2.0, 2.827, 0.1742, 0.6))
    table = front.obstacles[0].model_dump() | {"name": "cart", "path": path}
    moving = front.model_copy(
        update={"obstacles": (*front.obstacles, type(front.obstacles[0])(**table))}
    )
    hands = DraggedSolids()
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


def test_what_a_silent_sensor_saw_last_is_held_and_the_monitor_misses_it(front: Scenario) -> None:
    live = LiveTrial(front, "wb")
    for _ in range(100):
        live.step()
    whole = live.moment()
    rows, counts = np.unique(live.ctrl.cloud_origins()[:, 0], return_counts=True)
    live.off = frozenset([int(rows[0])])
    for _ in range(30):
        result = live.step()
    held = live.moment()
    assert len(held.held_W) == counts[0]
    assert np.isin(held.held_W, whole.kept_W).all()
    assert not np.isin(held.kept_W, whole.kept_W).all()
    assert result.mode in (DEGRADED, HOLD)  # HOLD: the goal lies where that sensor looked
    assert "sensor_silent" in held.found


def test_an_arm_whose_joint_state_is_no_number_is_drawn_where_it_is(front: Scenario) -> None:
    fault = Fault.model_validate({"kind": "joints_nan", "from": 0.05})
    live = LiveTrial(front.model_copy(update={"faults": (fault,)}), "wb")
    for _ in range(10):
        live.step()
    moment = live.moment()
    assert np.isfinite(moment.links_W).all()
    assert moment.mode == STOP
    assert np.isfinite(live.q).all()  # another trial begins there


def test_nothing_that_a_page_says_leads_out_of_a_stop(cell: Scenario) -> None:
    old_joints = Fault.model_validate({"kind": "joints_old", "value": 1.0, "from": 0.5, "to": 0.6})
    with started(cell.model_copy(update={"faults": (old_joints,)})) as link:
        listen(link, lambda update: update.moment and update.moment.mode == STOP)
        choice = Choice.of(cell, "wb")
        link.send(Request(reset=True))
        link.send(
            Request(choice=replace(choice, controller="sm"), release=True, silent=frozenset())
        )
        link.send(Request(running=False, steps=3))
        update = listen(link, lambda update: not update.running and update.moment)
        assert update.moment.mode == STOP
        assert update.moment.elapsed >= 0.5
        link.send(Request(restart=True, running=True))  # as the terminal does
        restarted = listen(link, lambda update: update.moment and update.moment.mode < STOP)
        assert restarted.moment.elapsed < 0.5


def test_a_page_that_takes_nothing_does_not_slow_the_simulation(cell: Scenario) -> None:
    with started(cell) as link:
        listen(link, lambda update: update.model)
        first = listen(link, lambda update: update.moment)

        def passed(update: Update) -> bool:
            clock.sleep(1.0)  # moments that are not fetched
            return update.dropped >= 5 and update.moment.elapsed > first.moment.elapsed + 0.5

        later = listen(link, lambda update: update.moment and passed(update))
        assert later.moment.elapsed > first.moment.elapsed + 0.5


def test_the_simulation_ends_with_its_page(cell: Scenario) -> None:
    with started(cell) as link:
        listen(link, lambda update: update.moment)
        link.close()
    assert multiprocessing.active_children() == []


def test_pause_step_and_reset(cell: Scenario) -> None:
    with started(cell) as link:
        link.send(Request(running=False))
        paused = listen(link, lambda update: update.moment and not update.running).moment
        link.send(Request(steps=7))
        stepped = listen(
            link, lambda update: update.moment and update.moment.elapsed > paused.elapsed
        )
        assert stepped.moment is not None
        assert stepped.moment.elapsed == pytest.approx(paused.elapsed + 0.07)
        link.send(Request(reset=True))
        again = listen(link, lambda update: update.moment and update.moment.elapsed < 0.07)
        assert np.array_equal(again.moment.q, cell.q0)


def test_another_choice_goes_on_where_the_arm_is_and_one_that_does_not_fit_changes_nothing(
    front: Scenario,
) -> None:
    with started(front) as link:
        before = listen(link, lambda update: update.moment and update.moment.elapsed > 0.5).moment
        choice = replace(Choice.of(front, "wb"), d_min=0.3, controller="sm")
        link.send(Request(choice=choice))
        stage = listen(link, lambda update: update.model)
        after = listen(link, lambda update: update.moment).moment
        link.send(Request(choice=replace(choice, d_min=9.0)))
        note = listen(link, lambda update: update.note).note
        back = listen(link, lambda update: update.refused)
    assert "d_min = 9: from 0.05 to 0.5" in note
    assert back.choice == choice
    assert stage.choice == choice
    assert stage.model is not None
    assert stage.model.d_min == 0.3
    assert np.abs(after.q - before.q).max() < 0.5
    assert after.elapsed > before.elapsed


@pytest.mark.long
def test_another_robot_starts_with_its_own_sensors(front: Scenario) -> None:
    with started(front) as link:
        listen(link, lambda update: update.moment)
        link.send(Request(choice=replace(Choice.of(front, "wb"), robot="panda")))
        stage = listen(link, lambda update: update.model).model
        moment = listen(link, lambda update: update.moment and len(update.moment.q) == 7).moment
    assert (stage.robot, len(stage.sensors)) == ("panda", 30)
    assert len(moment.links_W) == len(stage.links)


def test_meshes_are_prepared_beside_the_simulation_and_then_chosen(cell: Scenario) -> None:
    own = Choice.of(cell, "wb")
    preparation = Preparation(cell)
    assert preparation.asked(replace(own, d_min=0.3)) == replace(own, d_min=0.3)
    coarse = replace(own, vertices=100)
    assert preparation.asked(replace(own, vertices=300)) is None
    assert preparation.asked(coarse) is None  # in place of the other
    end = clock.monotonic() + 300.0
    while (ready := preparation.done()) is None and clock.monotonic() < end:
        assert preparation.busy
        clock.sleep(0.05)
    assert ready == coarse
    assert preparation.asked(coarse) == coarse
    preparation.close()
    assert multiprocessing.active_children() == []


def test_every_robot_with_sensors_can_stand_in_a_scene(front: Scenario) -> None:
    assert {"ur10e", "panda"} <= set(robots(front))
    changed = replace(Choice.of(front, "wb"), robot="panda", vertices=100).applied(front)
    assert (changed.robot, len(changed.q0)) == ("panda", 7)
    assert changed.obstacles == front.obstacles


def test_without_noise_the_ranges_are_exact(front: Scenario) -> None:
    quiet = replace(Choice.of(front, "wb"), noise=False).applied(front)
    settings = quiet.simulation
    assert (settings.sigma_ratio, settings.sigma_floor, settings.dropout, settings.bias) == (0,) * 4
    assert quiet.controller.monitor.suspect_repeats == 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"controller": "none"}, "controller = 'none': there are wb"),
        ({"robot": "/etc/passwd"}, "robot = '/etc/passwd': there are ur10e"),
        ({"vertices": 10**9}, "vertices"),
        ({"d_min": 0.0}, "d_min = 0: from 0.05"),
        ({"d_min": float("nan")}, "d_min = nan"),
        ({"buffer": -1.0}, "buffer"),
        ({"gain": 1e9}, "gain"),
    ],
)
def test_what_the_page_does_not_offer_cannot_be_chosen(
    front: Scenario, change: dict[str, Any], message: str
) -> None:
    with pytest.raises(px.ConfigError, match=re.escape(message)):
        replace(Choice.of(front, "wb"), **change).applied(front)


def test_the_last_wish_counts_and_the_room_has_walls() -> None:
    queue = CommandQueue()
    assert queue.take() is None
    queue.put(running=True)
    queue.put(running=False, steps=1)
    queue.put(steps=2)
    queue.move("panel", pose((1.0, 0.0, 0.0)))
    queue.move("panel", pose((1e9, 0.0, -1e9)))
    request = queue.take()
    assert request is not None
    assert (request.running, request.steps) == (False, 3)
    ((name, T_WO),) = request.moves
    assert name == "panel"
    assert T_WO[:3, 3].tolist() == [ROOM[1, 0], 0.0, ROOM[0, 2]]
    assert queue.take() is None


@given(st.integers(0, 40), st.integers(0, 40))
def test_removed_points_are_those_of_the_raw_cloud_that_were_not_kept(kept: int, gone: int) -> None:
    points = RNG.normal(size=(kept + gone, 3))
    order = RNG.permutation(kept + gone)
    left = without(points[order], points[:kept])
    assert sorted(map(tuple, left)) == sorted(map(tuple, points[kept:]))


def test_display_meshes_are_light_and_near_the_full_ones() -> None:
    robot = px.load_robot("ur10e")
    for link, (vertices_L, triangles) in zip(robot.link_names, display_meshes(robot), strict=True):
        assert len(vertices_L) <= 1100
        full, _ = robot.full_mesh(link)
        distances, *_ = px.MeshTree(vertices_L, triangles).closest(full[::50])
        assert distances.max() < 0.003


@contextmanager
def started(scenario: Scenario, controller: str = "wb") -> Iterator[Connection]:
    """A simulation in its process: the link to it."""
    context = multiprocessing.get_context("spawn")
    link, theirs = context.Pipe()
    process = context.Process(
        target=run_simulation, args=(theirs, scenario, controller), daemon=True
    )
    process.start()
    theirs.close()
    try:
        yield link
    finally:
        link.close()
        process.join(60.0)
        assert not process.is_alive()


def listen(link: Connection, until: Callable[[Update], Any], seconds: float = 120.0) -> Any:
    """Takes updates until that is true of one."""
    end = clock.monotonic() + seconds
    while clock.monotonic() < end:
        if link.poll(0.1):
            update: Update = link.recv()
            assert not update.failed, update.failed
            if update.moment is not None:
                link.send(None)
            if until(update):
                return update
    raise AssertionError("no such update came in time")

"""Memory and motion as the simulated sensors meet them: noise, self-hits, a moving arm."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import proxcgal as px
from proxcgal.recording.reader import read_recording
from proxcgal.recording.replay import first_difference
from proxcgal.recording.writer import Recorder
from proxcgal.scenario.loading import load_scenario
from proxcgal.scenario.setup import Setup
from proxcgal.sim.source import SimulatedSource
from proxcgal.sim.world import World
from proxcgal.trial.trial import run_trial

Array = NDArray[np.float64]

STILL = ("goal.offset=[0.0,0.0,0.001]", "controller.avoid_gain=0.001")  # the arm only watches


def ticks(
    robot: px.Robot, scene: str, overrides: tuple[str, ...], seed: int = 0
) -> Iterator[tuple[float, Any, Any]]:
    """Time, output and controller of each tick, with what the simulated sensors measure."""
    setup = Setup.of(load_scenario(scene, overrides), robot)
    ctrl = setup.make_controller("wb_memory")
    source = SimulatedSource(setup, World(robot, setup.scene), seed)
    while (inputs := source.read()) is not None:
        out = ctrl.tick(inputs.time, inputs.q, list(inputs.scans), inputs.goal)
        source.command(np.asarray(out.qd))
        yield inputs.time, out, ctrl


def body(shape: str, size: str, path: str) -> str:
    start = path[path.index(",") + 1 : path.index("]")].strip()
    return f'obstacle=[{{shape="{shape}",size={size},position=[{start}],path=[{path}]}}]'


def test_the_blind_post_is_touched_without_memory_and_kept_off_with_it(ur10e: px.Robot) -> None:
    scenario = load_scenario("memory_blind_post")
    plain = run_trial(scenario, "wb", robot=ur10e, sparse_truth=True).summary()
    memory = run_trial(scenario, "wb_memory", robot=ur10e, sparse_truth=True).summary()
    assert plain["true_min_m"] < 0.01
    assert memory["true_min_m"] >= 0.05
    assert memory["leaked_points_max"] == 0


@pytest.mark.parametrize("scene", ["front_plane", "memory_blind_post"])
def test_a_still_scene_seen_from_a_moving_arm_stands_still(ur10e: px.Robot, scene: str) -> None:
    speeds = [
        np.linalg.norm(out.obstacle_velocity_W)
        for _, out, _ in ticks(ur10e, scene, ("duration=5.0",))
        if out.pair is not None
    ]
    assert len(speeds) > 300
    assert np.percentile(speeds, 99) < 0.05


def test_a_body_that_comes_is_tracked_once_it_was_seen_three_times(ur10e: px.Robot) -> None:
    way = "[0.5,0.2,-0.95,0.7],[1.9,0.2,-0.25,0.7]"  # at 0.5 m/s
    overrides = (*STILL, body("box", "[0.4,0.2,0.6]", way), "duration=1.7")
    velocity, errors = np.array([0.0, 0.5, 0.0]), []
    for time, out, _ in ticks(ur10e, "side_plane", overrides):
        if time > 0.9 and out.pair is not None and out.pair.distance < 0.5:
            normal = (out.pair.surface_W - out.pair.obstacle_W) / out.pair.distance
            errors.append(abs(normal @ (out.obstacle_velocity_W - velocity)))
    assert len(errors) > 30
    assert max(errors) <= 0.1


def test_a_body_that_left_is_cleared_where_the_rays_pass_and_at_last_everywhere(
    ur10e: px.Robot,
) -> None:
    gone = "[0.5,0.4,-0.55,0.6],[0.51,0.4,-0.55,6.0]"
    overrides = (*STILL, body("box", "[1.2,0.02,1.0]", gone), "duration=2.8")
    left: dict[float, int] = {}
    seen = 0
    for time, _, ctrl in ticks(ur10e, "side_plane", overrides):
        left[round(time, 2)] = len(ctrl.cloud_W()) - ctrl.seen_points
        seen = ctrl.seen_points if time < 0.5 else seen
        assert max(ctrl.cloud_ages(time), default=0.0) <= 2.0 + 1e-9
    assert seen > 200
    assert left[0.8] < 0.1 * seen  # 0.3 s; what only the outermost rays pass may stay
    assert left[2.6] == 0


def test_replays_are_bit_identical(ur10e: px.Robot, tmp_path: Any) -> None:
    scenario = load_scenario("memory_blind_post", ["duration=3.0"])
    with Recorder(tmp_path / "run.mcap") as recorder:
        run_trial(scenario, "wb_memory", robot=ur10e, recorder=recorder)
    recording = read_recording(tmp_path / "run.mcap")
    remembered = [tick for tick in recording.ticks if tick.result.remembered]
    assert remembered
    assert first_difference(recording) is None


@pytest.mark.parametrize(
    ("assignment", "told"),
    [
        ("memory.voxel=1.0", "less than or equal to 0.5"),
        ("memory.max_points=2", "greater than or equal to 3"),
        ("memory.clear_scans=101", "less than or equal to 100"),
        ("motion.window=2.0", "less than or equal to 1"),
        ("motion.radius=1.5", "less than or equal to 1"),
    ],
)
def test_a_scenario_is_refused_whichever_controller_runs(assignment: str, told: str) -> None:
    key = assignment.partition("=")[0]
    with pytest.raises(px.ConfigError, match=rf"controller\.{key} = .*{told}"):
        load_scenario("side_plane", [f"controller.{assignment}"])


def test_what_is_not_a_number_or_below_nothing_is_refused() -> None:
    for keys in ({"memory_s": -1.0}, {"voxel": 0.0}, {"max_points": 0}, {"clear_scans": 0}):
        with pytest.raises(px.ConfigError, match=next(iter(keys))):
            px.MemoryConfig(**keys)
    for keys in ({"window": 0.0}, {"radius": np.inf}, {"confidence": -1.0}):
        with pytest.raises(px.ConfigError, match=next(iter(keys))):
            px.MotionConfig(**keys)

"""One look at a scene: its points are those that the controller senses and keeps."""

from pathlib import Path

import numpy as np
import pytest

import proxcgal as px
from proxcgal.scenario.fault_keys import Fault
from proxcgal.scenario.loading import load_scenario
from proxcgal.scenario.scenario import Scenario
from proxcgal.sim.static_scan import StaticScan, scan_static
from proxcgal.study.timing.inputs import SCENARIOS


@pytest.fixture(scope="module")
def scenario(arm_cell: Path) -> Scenario:
    return load_scenario(arm_cell)


@pytest.fixture(scope="module")
def snapshot(scenario: Scenario) -> StaticScan:
    return scan_static(scenario)


def test_the_points_are_those_that_the_controller_senses_and_keeps(snapshot: StaticScan) -> None:
    ctrl = snapshot.setup.make_controller("wb")
    ctrl.tick(0.0, snapshot.setup.q0, list(snapshot.scans), snapshot.setup.goal)
    np.testing.assert_allclose(snapshot.points_W, ctrl.raw_cloud_W(), atol=1e-12)
    kept = snapshot.points_W[snapshot.environment]
    np.testing.assert_allclose(kept, ctrl.cloud_W(), atol=1e-12)


def test_the_emitters_are_the_sensors(snapshot: StaticScan) -> None:
    setup = snapshot.setup
    poses_W = dict(zip(setup.robot.link_names, setup.robot.link_poses(setup.q0), strict=True))
    mounts_W = [(poses_W[m.link] @ m.T_LS)[:3, 3] for m in setup.skin.mounts]
    away = np.linalg.norm(snapshot.origins_W[:, None] - np.array(mounts_W), axis=2).min(axis=1)
    assert away.max() < 1e-12


def test_the_tolerance_is_at_least_the_filters_and_grows_with_range(snapshot: StaticScan) -> None:
    away = np.linalg.norm(snapshot.points_W - snapshot.origins_W, axis=1)
    assert snapshot.tolerance.min() >= px.FilterConfig().tolerance
    assert snapshot.tolerance[away.argmax()] > snapshot.tolerance[away.argmin()]


def test_a_crop_keeps_the_rays_up_to_its_length(snapshot: StaticScan) -> None:
    near = snapshot.within(1.0)
    away = np.linalg.norm(near.points_W - near.origins_W, axis=1)
    assert away.max() <= 1.0
    every = np.linalg.norm(snapshot.points_W - snapshot.origins_W, axis=1)
    assert len(near.points_W) == (every <= 1.0).sum()
    assert near.environment.shape == near.tolerance.shape == (len(near.points_W),)


def test_more_scans_make_a_larger_cloud_of_the_same_scene(scenario: Scenario) -> None:
    once, often = scan_static(scenario), scan_static(scenario, 40)
    n = len(once.points_W)
    np.testing.assert_array_equal(often.points_W[:n], once.points_W)
    assert len(often.scans) == 40 * len(once.scans)
    assert len(often.points_W) == pytest.approx(40 * n, rel=0.05)


def test_sensors_that_take_turns_are_asked_together(scenario: Scenario) -> None:
    turns = scenario.simulation.model_copy(update={"stagger": True})
    taken = scan_static(scenario.model_copy(update={"simulation": turns}))
    np.testing.assert_array_equal(taken.points_W, scan_static(scenario).points_W)


@pytest.mark.parametrize("name", SCENARIOS)
def test_the_built_in_scenes_have_the_papers_clouds(name: str) -> None:
    taken = scan_static(load_scenario(name))
    sizes = [int(taken.within(reach).environment.sum()) for reach in (np.inf, 2.0, 1.0)]
    assert sizes[0] > 1500
    assert sizes[1] == pytest.approx(600, rel=0.1)
    assert sizes[2] == pytest.approx(200, rel=0.1)


def test_sensors_that_a_fault_moves_stand_where_they_should(scenario: Scenario) -> None:
    moved = Fault.model_validate({"kind": "mount_offset", "value": 0.1, "sensor": "all"})
    taken = scan_static(scenario.model_copy(update={"faults": (moved,)}))
    np.testing.assert_array_equal(taken.points_W, scan_static(scenario).points_W)

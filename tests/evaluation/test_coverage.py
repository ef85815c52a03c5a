"""Coverage: what the sensors have in view, against what they measure and against geometry."""

import igl
import numpy as np
import pytest

import proxcgal as px
from proxcgal.core.transforms import inverse, placed
from proxcgal.evaluation.blind_volume import blind_volume, distances, last_seen, volume_within
from proxcgal.evaluation.coverage import Coverage, coverage_of, sightings
from proxcgal.evaluation.visibility import Visibility
from proxcgal.scenario.loading import load_scenario
from proxcgal.scenario.setup import Setup
from proxcgal.sim.source import SimulatedSource
from proxcgal.sim.world import World
from proxcgal.trial.trial import run_trial

IDEAL = ("simulation.sigma_floor=0.0", "simulation.sigma_ratio=0.0", "simulation.dropout=0.0")


def test_what_a_sensor_measured_is_in_view(ur10e: px.Robot) -> None:
    setup = Setup.of(load_scenario("side_plane", IDEAL), ur10e)
    ctrl = setup.make_controller("wb")
    source = SimulatedSource(setup, World(ur10e, setup.scene), 0)
    inputs = source.read()
    assert inputs is not None
    ctrl.tick(inputs.time, inputs.q, list(inputs.scans), inputs.goal)
    cloud_W = np.asarray(ctrl.cloud_W())
    assert len(cloud_W) > 100
    assert Visibility(setup, setup.scene).see(inputs.q, cloud_W).all()
    # Behind the panel nothing is, and without it everything.
    behind_W = cloud_W + np.array([0.0, -0.1, 0.0])
    assert not Visibility(setup, setup.scene).see(inputs.q, behind_W).any()
    assert Visibility(setup, None).see(inputs.q, behind_W).mean() > 0.9


def test_outside_of_every_field_of_view_nothing_is_in_view(ur10e: px.Robot) -> None:
    setup = Setup.of(load_scenario("side_plane"), ur10e)
    T_WL = ur10e.link_poses(setup.q0)[list(ur10e.link_names).index("forearm_link")]
    forearm = np.asarray(ur10e.mesh("forearm_link")[0]) @ T_WL[:3, :3].T + T_WL[:3, 3]
    along = np.linalg.svd(forearm - forearm.mean(axis=0))[2][0]
    ahead_W = forearm.mean(axis=0) + np.outer(np.linspace(0.5, 1.2, 10), along)
    assert not Visibility(setup, None).see(setup.q0, ahead_W).any()


def test_shares_of_the_closest_points_add_up(ur10e: px.Robot) -> None:
    scenario = load_scenario("memory_blind_post", ["duration=4.0"])
    log = run_trial(scenario, "wb", robot=ur10e, sparse_truth=True, coverage=True)
    numbers = log.coverage.numbers()
    assert sum(numbers.values()) == pytest.approx(1.0)
    assert numbers["in_view_share"] > 0.2
    assert numbers["remembered_share"] > 0.2  # the post has left the view
    # With no memory at all what left the view is forgotten.
    none = Setup.of(load_scenario("memory_blind_post", ["controller.memory.memory_s=0.0"]), ur10e)
    again = coverage_of(none, log.q, log.elapsed)
    assert again.remembered == 0.0
    assert again.forgotten == pytest.approx(numbers["remembered_share"])


def test_a_moment_tells_what_the_shares_count(ur10e: px.Robot) -> None:
    scenario = load_scenario("memory_blind_post", ["duration=4.0"])
    log = run_trial(scenario, "wb", robot=ur10e, sparse_truth=True, coverage=True)
    assert log.sightings is not None
    assert log.true_m[log.nearest_tick] == np.nanmin(log.true_m)
    setup = Setup.of(scenario, ur10e)
    ticks = range(0, len(log.time), 20)
    found = sightings(setup, log.q, log.elapsed, ticks)
    for kind, share in log.coverage.numbers().items():
        assert np.mean([f"{one.kind}_share" == kind for one in found]) == pytest.approx(share)
    for one in found:
        assert (one.kind == "never_seen") == np.isinf(one.age_s)
        assert one.kind != "remembered" or 0.0 < one.age_s <= 2.0
    both = sightings(setup, log.q, log.elapsed, (log.nearest_tick, len(log.time) - 1))
    assert both == log.sightings


def test_without_a_scene_there_is_nothing_to_cover(ur10e: px.Robot) -> None:
    setup = Setup.of(load_scenario("side_plane", ["obstacle=[]"]), ur10e)
    shares = coverage_of(setup, setup.q0[None], np.zeros(1)).numbers()
    assert shares.keys() == Coverage().numbers().keys()
    assert np.isnan(list(shares.values())).all()


def test_the_volume_is_all_within_reach_of_the_arm(ur10e: px.Robot) -> None:
    q = np.array(load_scenario("side_plane").q0)
    points_W = volume_within(ur10e, q, reach=0.2)
    assert len(points_W) > 500
    far = distances(ur10e, q, points_W)
    assert (far <= 0.2).all()
    nearest = [px.closest_pair(ur10e, q, points_W[row : row + 1]).distance for row in (0, 99, 400)]
    assert far[[0, 99, 400]] == pytest.approx(nearest, abs=1e-9)


def test_the_arms_own_inside_is_no_part_of_the_volume(ur10e: px.Robot) -> None:
    q = np.array(load_scenario("side_plane").q0)
    points_W = volume_within(ur10e, q, reach=0.1)
    points_W = points_W[distances(ur10e, q, points_W) > 1e-9]  # on a surface is neither
    for name, T_WL in zip(ur10e.link_names, ur10e.link_poses(q), strict=True):
        vertices_L, triangles = ur10e.mesh(name)
        points_L = placed(inverse(T_WL), points_W)
        around = igl.winding_number(vertices_L, triangles.astype(np.int64), points_L)
        assert (np.abs(around) <= 0.5).all()


def test_a_path_sees_more_than_its_end_and_the_share_never_rises_with_time(
    ur10e: px.Robot,
) -> None:
    setup = Setup.of(load_scenario("side_plane"), ur10e)
    turned = setup.q0 + np.array([0.8, 0.0, 0.0, 0.0, 0.0, 0.0])
    volume = blind_volume(setup, [0.0, 1.0], [turned, setup.q0])
    shares = [volume.share_unseen_for(seconds) for seconds in (0.0, 0.5, 1.0, 2.0)]
    assert shares == sorted(shares, reverse=True)
    assert shares[0] == shares[1] > shares[2] == shares[3] > 0.1
    alone = last_seen(setup, volume.points_W, [1.0], [setup.q0])
    assert (np.isinf(alone) == (volume.ages > 0.0)).all()


def test_beside_a_person_the_closest_points_are_theirs_whatever_else_is_sensed(
    ur10e: px.Robot,
) -> None:
    panel = 'obstacle=[{name="panel",size=[1.4,0.02,1.2],position=[0.4,-0.4,0.4]}]'
    setup = Setup.of(load_scenario("hri_task1", ["duration=0.5", panel]), ur10e)
    elapsed = 0.01 * np.arange(50)
    q = np.tile(setup.q0, (50, 1))
    assert coverage_of(setup, q, elapsed) == Coverage(0.0, 0.0, 0.0, 1.0)  # they are far

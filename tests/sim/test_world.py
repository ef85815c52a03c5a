"""The simulated world: rays, ranges, true distances and pictures against independent answers."""

from itertools import combinations

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

import proxcgal as px
from proxcgal.core.transforms import placed
from proxcgal.evaluation.ground_truth import GroundTruth
from proxcgal.evaluation.sparse_ground_truth import sparse_ground_truth
from proxcgal.models.surfaces import ALWAYS_NEAR, Surfaces
from proxcgal.scenario.loading import load_scenario
from proxcgal.scenario.setup import Setup
from proxcgal.scenario.simulation_keys import SimulationKeys
from proxcgal.scenario.skin_keys import SensorKeys
from proxcgal.scene.obstacle_keys import Obstacle
from proxcgal.scene.obstacles import ObstacleScene
from proxcgal.sim.picture import Arrow, Camera, Spheres
from proxcgal.sim.range_sensor import NO_TARGET, VALID, RangeModel
from proxcgal.sim.source import SimulatedSource
from proxcgal.sim.world import World, mujoco

Array = NDArray[np.float64]

Q = np.array([0.3, -1.7, 1.9, -1.7, -1.57, 0.2])
PANEL = Obstacle(size=(0.02, 1.0, 1.0), position=(0.9, 0.1, 0.6), rpy=(0.1, 0.2, 0.3))
BESIDE_PANEL = ObstacleScene([PANEL])
ALONE = ObstacleScene([])


@pytest.fixture(scope="module")
def ur10e() -> px.Robot:
    return px.load_robot("ur10e")


@pytest.fixture(scope="module")
def world(ur10e: px.Robot) -> World:
    return World(ur10e, BESIDE_PANEL)


def rays(n: int, seed: int = 0) -> tuple[Array, Array]:
    """Origins round the arm, unit directions all over."""
    generator = np.random.default_rng(seed)
    directions = generator.normal(size=(n, 3))
    return (
        generator.uniform([-0.3, -0.6, 0.0], [1.2, 0.8, 1.4], (n, 3)),
        directions / np.linalg.norm(directions, axis=1)[:, None],
    )


def surfaces_in_world(robot: px.Robot, q: Array) -> list[tuple[Array, Array]]:
    """Vertices in world and triangles of every full mesh, and of the panel last."""
    out = []
    for name, pose in zip(robot.link_names, robot.link_poses(q), strict=True):
        vertices, triangles = robot.full_mesh(name)
        out.append((vertices @ pose[:3, :3].T + pose[:3, 3], triangles))
    return [*out, surface_of(PANEL)]


def surface_of(obstacle: Obstacle) -> tuple[Array, NDArray[np.int32]]:
    """Vertices in world and triangles of its core."""
    vertices_O, triangles = obstacle.solid().core()
    return placed(obstacle.pose(), vertices_O), triangles


def test_rays_hit_where_mujoco_says(world: World) -> None:
    """MuJoCo casts at the scene alone; here at links and scene, as it once did for every scan."""
    world.place(Q)
    origins, directions = rays(2000)
    hits = world.cast(origins, directions[:, None])
    lengths, own = hits.length[:, 0], hits.robot[:, 0]
    both, geom = np.array([1, 1, 0, 0, 0, 0], np.uint8), np.empty(1, np.int32)
    found = np.empty((2000, 2))
    for row, ray in enumerate(zip(origins, directions, strict=True)):
        far = mujoco.mj_ray(world._model, world._data, *ray, both, True, -1, geom, None)
        found[row] = far, world._model.geom_bodyid[geom[0]]
    expected = np.where(found[:, 0] < 0.0, np.inf, found[:, 0])
    hit = np.isfinite(expected)
    assert hit.sum() > 300
    np.testing.assert_array_equal(np.isfinite(lengths), hit)
    np.testing.assert_allclose(lengths[hit], expected[hit], atol=1e-6)
    np.testing.assert_array_equal(own[hit], found[hit, 1] <= 7)  # the links' bodies come first


def test_a_robots_second_world_has_its_own_obstacles(ur10e: px.Robot, world: World) -> None:
    """MuJoCo's model of a robot is compiled once; boxes are put into copies of it."""
    moved = Obstacle(size=(0.4, 0.03, 0.7), position=(0.5, -0.4, 0.9), rpy=(0.5, -0.2, 1.0))
    second = World(ur10e, ObstacleScene([moved]))
    origins, directions = rays(1500, seed=6)
    for each, box in ((world, PANEL), (second, moved)):
        each.place(Q)
        hits = each.cast(origins, directions[:, None])
        tree = px.MeshTree(*surface_of(box))
        alone = tree.first_hit(origins, directions)
        on_box = np.isfinite(hits.length[:, 0]) & ~hits.robot[:, 0]
        assert on_box.sum() > 20
        np.testing.assert_allclose(hits.length[on_box, 0], alone[on_box], atol=1e-9)
        assert (hits.length[:, 0] <= alone + 1e-9).all()


def test_rays_hit_where_trimesh_says(ur10e: px.Robot, world: World) -> None:
    world.place(Q)
    parts = [trimesh.Trimesh(*surface, process=False) for surface in surfaces_in_world(ur10e, Q)]
    corners = trimesh.util.concatenate(parts).triangles
    origins, directions = rays(60, seed=1)
    for origin, direction in zip(origins, directions, strict=True):
        length = world.cast(origin[None], direction[None, None]).length[0, 0]
        expected = first_hit_by_plane_equations(corners, origin, direction)
        assert length == expected or abs(length - expected) < 1e-6


def first_hit_by_plane_equations(corners: Array, origin: Array, direction: Array) -> float:
    """Every triangle's plane is met, and the point's barycentric coordinates are looked at."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.einsum("ni,ni->n", normals, corners[:, 0] - origin) / (normals @ direction)
    ahead = np.isfinite(t) & (t >= 0.0)
    points = origin + t[ahead, None] * direction
    inside = trimesh.triangles.points_to_barycentric(corners[ahead], points).min(axis=1) >= -1e-9
    return float(t[ahead][inside].min(initial=np.inf))


def test_many_rays_at_once_give_what_single_rays_give(world: World) -> None:
    world.place(Q)
    _, directions = rays(300, seed=2)
    origin = np.array([0.5, 0.3, 0.9])
    together = world.cast(origin[None], directions[None]).length[0]
    single = world.cast(np.tile(origin, (300, 1)), directions[:, None]).length[:, 0]
    np.testing.assert_array_equal(together, single)


def test_a_ray_goes_on_behind_its_own_mounting(world: World) -> None:
    world.place(Q)
    near = np.array([0.9, 0.1, 0.6]) - 0.5 * 0.02 * PANEL.pose()[:3, 0]
    out = -PANEL.pose()[:3, 0]
    inside = near - 0.003 * out
    bundle = inside[None], out[None, None]
    assert world.cast(*bundle).length[0, 0] == pytest.approx(0.003, abs=1e-9)
    assert world.cast(*bundle, start=0.005).length[0, 0] > 0.1


def test_an_arm_without_finite_pose_is_an_error(world: World) -> None:
    with pytest.raises((px.SimulationError, px.GeometryError)):
        world.place(np.array([np.nan, 0, 0, 0, 0, 0]))


def test_a_warning_of_mujoco_fails_the_run(world: World) -> None:
    world._warnings.append("something diverged")
    with pytest.raises(px.SimulationError, match="something diverged"):
        world.place(Q)


SENSOR = SensorKeys()


def model(**changes: float) -> RangeModel:
    return RangeModel(SimulationKeys(**changes), SENSOR, sensors=200, seed=5)


def lengths_to_wall(ranges: RangeModel, distance: float) -> Array:
    """A wall across the sensor's axis: every zone reads the same z."""
    return np.tile(distance / ranges.rays_S[:, 2], (200, 1))


@pytest.mark.parametrize("sub_rays", [1, 4, 9, 16])
def test_a_flat_wall_reads_the_same_in_all_zones(sub_rays: int) -> None:
    ranges = model(sigma_floor=0.0, sigma_ratio=0.0, dropout=0.0, sub_rays=sub_rays)
    found, status = ranges.measure(range(200), 0, lengths_to_wall(ranges, 0.7))
    np.testing.assert_array_equal(found, 0.7)
    np.testing.assert_array_equal(status, VALID)


def test_rays_go_through_the_middle_of_their_zones() -> None:
    rays_S = model().rays_S
    directions = rays_S / rays_S[:, 2:]
    np.testing.assert_allclose(directions, px.zone_directions(px.SensorModel()), atol=1e-15)


def test_sub_rays_fill_a_zone_98_mm_wide_at_1_m() -> None:
    rays_S = model(sub_rays=9).rays_S.reshape(64, 9, 3)
    across = (rays_S / rays_S[..., 2:])[..., 0]
    widths = 1.5 * (across.max(axis=1) - across.min(axis=1))
    assert widths.min() == pytest.approx(0.098, abs=0.002)
    assert np.diff(np.sort(across[:8].ravel().round(12))).max() < 0.045


def test_the_nearest_sub_ray_counts() -> None:
    ranges = model(sigma_floor=0.0, sigma_ratio=0.0, dropout=0.0, sub_rays=9)
    lengths = lengths_to_wall(ranges, 0.9)
    lengths[:, 4::9] = 0.5 / ranges.rays_S[4::9, 2]
    found, _ = ranges.measure(range(200), 0, lengths)
    np.testing.assert_array_equal(found, 0.5)
    hit = np.zeros(lengths.shape, bool)
    hit[:, 4::9] = True
    assert ranges.pick(lengths, hit).all()


@pytest.mark.parametrize(("distance", "sigma"), [(0.2, 0.005), (1.2, 0.018)])
def test_noise_has_the_spread_and_mean_asked_for(distance: float, sigma: float) -> None:
    ranges = model(dropout=0.0, bias=0.01)
    found, _ = ranges.measure(range(200), 0, lengths_to_wall(ranges, distance))
    assert found.size == 12800
    assert found.std() == pytest.approx(sigma, rel=0.03)
    assert found.mean() == pytest.approx(distance + 0.01, abs=4.0 * sigma / found.size**0.5)


def test_two_percent_of_the_zones_drop_out() -> None:
    ranges = model()
    found, status = ranges.measure(range(200), 0, lengths_to_wall(ranges, 0.5))
    lost = status == NO_TARGET
    assert lost.mean() == pytest.approx(0.02, abs=0.005)
    assert (found[lost] == 0.0).all()


def test_ranges_come_in_whole_millimetres() -> None:
    ranges = model()
    found, _ = ranges.measure(range(200), 0, lengths_to_wall(ranges, 0.5))
    np.testing.assert_array_equal(found, np.rint(found * 1000.0) / 1000.0)


@pytest.mark.parametrize("distance", [0.001, 4.5, np.inf])
def test_out_of_range_means_no_target(distance: float) -> None:
    ranges = model()
    _, status = ranges.measure(range(200), 0, lengths_to_wall(ranges, distance))
    assert (status == NO_TARGET).all()


def test_the_asked_share_of_targets_is_uncertain() -> None:
    ranges = model(uncertain=0.1, dropout=0.0)
    _, status = ranges.measure(range(200), 0, lengths_to_wall(ranges, 0.5))
    assert np.isin(status, [6, 9]).mean() == pytest.approx(0.1, abs=0.01)
    assert set(np.unique(status)) == {5, 6, 9}


def test_noise_belongs_to_scan_and_sensor_whatever_the_order() -> None:
    ahead, back = model(), model()
    lengths = lengths_to_wall(ahead, 0.6)
    forward = {i: ahead.measure(range(200), i, lengths)[0] for i in range(4)}
    for index in reversed(range(4)):
        for row in (150, 3):
            one, _ = back.measure([row], index, lengths[:1])
            np.testing.assert_array_equal(one[0], forward[index][row])
    assert len({scan.tobytes() for scan in forward.values()}) == 4


def test_scans_are_taken_where_the_arm_was_at_their_stamp(ur10e: px.Robot) -> None:
    quiet = ["simulation.sigma_floor=0", "simulation.sigma_ratio=0", "simulation.dropout=0"]
    scenario = load_scenario("front_plane", [*quiet, "duration=0.3"])
    setup = Setup.of(scenario, ur10e)
    source = SimulatedSource(setup, World(ur10e, scenario.scene()), 0)
    qd = np.array([0.4, 0.3, -0.2, 0.5, 0.1, 0.0])
    scans = []
    while (inputs := source.read()) is not None:
        scans += inputs.scans
        for scan in inputs.scans:
            assert inputs.time - 0.01 < scan.stamp <= inputs.time
        source.command(qd)
    assert sorted({scan.stamp for scan in scans}) == [k / 15.0 for k in range(5)]
    assert len(scans) == 5 * len(setup.skin)
    still = World(ur10e, scenario.scene())
    for scan in scans[-3:]:
        q = setup.q0 + qd * scan.stamp
        still.place(q)
        mount = setup.skin.mounts[scan.sensor]
        pose = ur10e.link_poses(q)[list(ur10e.link_names).index(mount.link)] @ mount.T_LS
        directions = RangeModel(SimulationKeys(), SENSOR, 1, 0).rays_S
        hits = still.cast(pose[None, :3, 3], (directions @ pose[:3, :3].T)[None], 0.005)
        seen = np.asarray(scan.status) == VALID
        expected = hits.length[0] * directions[:, 2]
        np.testing.assert_allclose(np.asarray(scan.ranges)[seen], expected[seen], atol=0.000501)


def test_staggered_sensors_take_turns(ur10e: px.Robot) -> None:
    scenario = load_scenario("front_plane", ["simulation.stagger=true", "duration=0.2"])
    source = SimulatedSource(Setup.of(scenario, ur10e), World(ur10e, scenario.scene()), 0)
    stamps: dict[int, list[float]] = {}
    while (inputs := source.read()) is not None:
        for scan in inputs.scans:
            stamps.setdefault(scan.sensor, []).append(scan.stamp)
        source.command(np.zeros(6))
    assert len({times[0] for times in stamps.values()}) == 30
    for times in stamps.values():
        np.testing.assert_allclose(np.diff(times), 1.0 / 15.0)


def test_true_distance_never_exceeds_that_to_dense_samples_of_the_panel(ur10e: px.Robot) -> None:
    truth = GroundTruth(ur10e, BESIDE_PANEL)
    points = placed(PANEL.pose(), PANEL.solid().points(0.01))
    generator = np.random.default_rng(3)
    for _ in range(3):
        q = Q + generator.uniform(-0.3, 0.3, 6)
        distance, link = truth(q)[:2]
        poses = dict(zip(ur10e.link_names, ur10e.link_poses(q), strict=True))
        T = np.linalg.inv(poses[link])
        sampled = px.MeshTree(*ur10e.full_mesh(link)).closest(points @ T[:3, :3].T + T[:3, 3])[0]
        assert distance <= sampled.min() + 1e-12
        assert sampled.min() - distance < 0.0025


def test_true_distance_skips_nothing_on_a_moving_arm(ur10e: px.Robot) -> None:
    """The bound that saves work must not change the answer."""
    moving = GroundTruth(ur10e, BESIDE_PANEL)
    qd = np.array([0.3, 0.4, -0.5, 0.2, 0.3, 0.1])
    own = []
    for k in range(60):
        q = Q + 0.01 * k * qd
        distance, link, own_distance = moving(q)[:3]
        own.append(own_distance)
        if k % 10 == 0:
            fresh, fresh_link, fresh_own = GroundTruth(ur10e, BESIDE_PANEL)(q)[:3]
            assert (distance, link) == (pytest.approx(fresh, abs=1e-12), fresh_link)
            assert min(own) <= fresh_own + 1e-12


def test_own_distance_reaches_its_least_exactly(ur10e: px.Robot) -> None:
    truth = GroundTruth(ur10e, ALONE)
    path = [Q + np.array([0.0, 0.0, 0.02 * k, 0.0, 0.0, 0.0]) for k in range(25)]
    least = min(truth(q)[2] for q in path)
    assert least == pytest.approx(
        min(GroundTruth(ur10e, ALONE)(q)[2] for q in path[::4] + path[-1:])
    )


@pytest.mark.parametrize("moves", [False, True])
def test_truth_where_it_decides_is_the_truth_of_every_tick(ur10e: px.Robot, moves: bool) -> None:
    """What the bounds leave out is no new least, no violation and not wanted."""
    position = (0.78, 0.1, 0.6)
    path = ((0.0, *position), (0.6, 0.85, 0.1, 0.6), (1.0, 0.78, 0.3, 0.6)) if moves else ()
    scene = ObstacleScene([PANEL.model_copy(update={"position": position, "path": path})])
    time = 0.01 * np.arange(120)
    qd = np.array([0.3, 0.4, -0.5, 0.2, 0.3, 0.1])
    q = np.array([Q + 0.4 * np.sin(0.05 * k) * qd for k in range(120)])
    wanted = np.arange(len(q)) >= 100
    truth = GroundTruth(ur10e, scene)
    every = [truth(posture, moment) for posture, moment in zip(q, time, strict=True)]
    distance = np.array([tick[0] for tick in every])
    under = float(np.quantile(distance, 0.2))
    found = sparse_ground_truth(ur10e, scene, time, q, wanted, under)
    asked = ~np.isnan(found.distance)
    assert asked[wanted].all()
    assert asked[distance < under].all()
    assert asked.sum() < 90
    np.testing.assert_array_equal(found.distance[asked], distance[asked])
    assert [found.link[k] for k in np.flatnonzero(asked)] == [
        every[k][1] for k in np.flatnonzero(asked)
    ]
    assert np.nanmin(found.distance) == distance.min()
    assert np.nanmin(found.own) == min(tick[2] for tick in every)
    assert np.isnan(found.own).any()


def test_neighbours_and_links_built_close_together_do_not_count(ur10e: px.Robot) -> None:
    surfaces = Surfaces.of(ur10e)
    pairs = {(a, b) for a, b in surfaces.self_pairs.tolist()}
    assert pairs
    assert not pairs & {(k, k + 1) for k in range(len(ur10e.link_names) - 1)}
    generator = np.random.default_rng(9)
    left_out = set(combinations(range(len(ur10e.link_names)), 2)) - pairs
    for a, b in left_out - {(k, k + 1) for k in range(len(ur10e.link_names) - 1)}:
        for _ in range(3):
            poses = ur10e.link_poses(generator.uniform(-np.pi, np.pi, 6))
            T_AB = np.linalg.inv(poses[a]) @ poses[b]
            assert surfaces.trees[a].distance(surfaces.trees[b], T_AB)[0] < ALWAYS_NEAR


def test_a_picture_shows_what_is_marked_in_it(world: World) -> None:
    world.place(Q)
    plain = world.picture(size=(320, 240))
    red = (1.0, 0.0, 0.0, 1.0)
    cloud = Spheres(np.array([[0.35, -0.4, 0.9]]), 0.05, red)
    arrow = Arrow(
        np.array([0.2, -0.4, 0.5]), np.array([0.5, -0.4, 0.5]), 0.02, (0.0, 0.0, 1.0, 1.0)
    )
    marked = world.picture([cloud, arrow], (320, 240), Camera(azimuth=np.pi / 2))
    again = world.picture(size=(320, 240))
    assert plain.shape == (240, 320, 3)
    np.testing.assert_array_equal(plain, again)
    reddish = (marked[..., 0] > 150) & (marked[..., 1] < 90) & (marked[..., 2] < 90)
    bluish = (marked[..., 2] > 150) & (marked[..., 0] < 90) & (marked[..., 1] < 90)
    assert reddish.sum() > 50
    assert bluish.sum() > 50
    assert plain.mean() > 120

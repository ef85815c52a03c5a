"""Scenes: shapes, where they are, how fast, and how far from a robot."""

import math
from pathlib import Path

import coal
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

import proxcgal as px
from proxcgal import _core
from proxcgal.core.transforms import inverse, placed, pose
from proxcgal.evaluation.ground_truth import GroundTruth
from proxcgal.evaluation.sparse_ground_truth import half_box
from proxcgal.recording.reader import read_recording
from proxcgal.recording.replay import first_difference
from proxcgal.recording.writer import Recorder
from proxcgal.scenario.loading import load_scenario
from proxcgal.scene.obstacle_keys import Obstacle
from proxcgal.scene.obstacles import KnownCloud, ObstacleScene
from proxcgal.scene.solids import Box, CapsuleSolid, Cylinder, Solid, Sphere
from proxcgal.sim.world import World
from proxcgal.trial.trial import run_trial

Array = NDArray[np.float64]

SOLIDS: tuple[Solid, ...] = (
    Box((0.2, 0.5, 0.31)), Cylinder(0.1, 0.7), CapsuleSolid(0.08, 0.4), Sphere(0.15)
)  # fmt: skip
Q = np.array([0.3, -1.7, 1.9, -1.7, -1.57, 0.2])
solids = pytest.mark.parametrize("solid", SOLIDS, ids=lambda solid: type(solid).__name__)
points = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array)


@pytest.fixture(scope="module")
def ur10e() -> px.Robot:
    return px.load_robot("ur10e")


def obstacle(solid: Solid, **keys: object) -> Obstacle:
    """One of that shape in front of the arm."""
    sizes = {
        Box: lambda s: s.size, Cylinder: lambda s: (s.radius, s.height),
        CapsuleSolid: lambda s: (s.radius, s.length), Sphere: lambda s: (s.radius,),
    }  # fmt: skip
    inputs = {"position": (0.9, 0.3, 0.5), "rpy": (0.4, -0.3, 0.2), **keys}
    shape = type(solid).__name__.lower().removesuffix("solid")
    return Obstacle(shape=shape, size=sizes[type(solid)](solid), **inputs)


def distance_to_surface(solid: Solid, points_O: Array) -> Array:
    """(n,) from points outside, by core and rounding."""
    return _core.MeshTree(*solid.core()).closest(points_O)[0] - solid.rounding


@solids
def test_a_closed_core_points_outward(solid: Solid) -> None:
    volumes = {Box: 0.2 * 0.5 * 0.31, Cylinder: math.pi * 0.1**2 * 0.7}
    if type(solid) not in volumes:
        pytest.skip("its core is a line or a point")
    vertices, triangles = solid.core()
    corners = vertices[triangles]
    volume = np.einsum("ni,ni->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    assert volume.sum() == pytest.approx(volumes[type(solid)], rel=1e-3)


@solids
def test_points_lie_on_the_surface_no_farther_apart_than_asked(solid: Solid) -> None:
    spacing = 0.05
    points_O = solid.points(spacing)
    assert np.abs(distance_to_surface(solid, points_O)).max() < 6e-5
    others = np.linalg.norm(points_O[:, None] - points_O[None], axis=2) + 9.0 * np.eye(
        len(points_O)
    )
    assert others.min(axis=1).max() <= spacing + 1e-12


@solids
@given(point_O=points)
def test_the_nearest_point_is_as_far_as_the_surface(solid: Solid, point_O: Array) -> None:
    far = np.linalg.norm(point_O - solid.nearest(point_O))
    expected = distance_to_surface(solid, point_O[None])[0]
    if far > 0.0:
        assert far == pytest.approx(max(expected, 0.0), abs=6e-5)
    assert (np.abs(solid.nearest(point_O)) <= solid.extent + 1e-12).all()


@solids
def test_rays_meet_each_shape_where_its_equation_says(ur10e: px.Robot, solid: Solid) -> None:
    body = obstacle(solid)
    world = World(ur10e, ObstacleScene([body]))
    world.place(Q)
    generator = np.random.default_rng(4)
    origins = generator.uniform([0.3, -0.8, 0.0], [1.5, 1.0, 1.3], (2500, 3))
    to = generator.normal(body.position, 0.15, (2500, 3)) - origins
    hits = world.cast(origins, (to / np.linalg.norm(to, axis=1)[:, None])[:, None])
    on_solid = np.isfinite(hits.length[:, 0]) & ~hits.robot[:, 0]
    assert on_solid.sum() > 500
    along = hits.length[on_solid] * to[on_solid] / np.linalg.norm(to[on_solid], axis=1)[:, None]
    points_O = placed(inverse(body.pose()), origins[on_solid] + along)
    assert np.abs(distance_to_surface(solid, points_O)).max() < 6e-5


@solids
def test_true_distance_to_each_shape_is_that_of_coal(ur10e: px.Robot, solid: Solid) -> None:
    body = obstacle(solid)
    shapes = {
        Box: lambda s: coal.Box(*s.size), Cylinder: lambda s: coal.Cylinder(s.radius, s.height),
        CapsuleSolid: lambda s: coal.Capsule(s.radius, s.length),
        Sphere: lambda s: coal.Sphere(s.radius),
    }  # fmt: skip
    shape = shapes[type(solid)](solid)
    truth = GroundTruth(ur10e, ObstacleScene([body]))
    found = truth(Q)
    T_WL = dict(zip(ur10e.link_names, ur10e.link_poses(Q), strict=True))[found.link]
    model = coal.BVHModelOBBRSS()
    vertices, triangles = ur10e.full_mesh(found.link)
    corners_W = placed(T_WL, vertices)[triangles]
    far = np.linalg.norm(corners_W.mean(axis=1) - found.obstacle_W, axis=1)
    model.beginModel(1200, 400)
    for corners in corners_W[far.argsort()[:400]]:
        model.addTriangle(*corners)
    model.endModel()
    places = [coal.Transform3s(T[:3, :3], T[:3, 3]) for T in (np.eye(4), body.pose())]
    expected = coal.distance(
        model, places[0], shape, places[1], coal.DistanceRequest(), coal.DistanceResult()
    )
    assert found.distance == pytest.approx(expected, abs=6e-5)
    surface_O = placed(inverse(body.pose()), found.obstacle_W[None])
    assert abs(distance_to_surface(solid, surface_O)[0]) < 6e-5
    assert found.obstacle == "panel"


def test_true_distance_skips_nothing_where_the_scene_moves(ur10e: px.Robot) -> None:
    path = ((0.0, 0.9, 0.3, 0.5), (1.0, 0.7, -0.4, 0.9), (1.5, 0.7, -0.4, 0.9))
    scene = ObstacleScene([obstacle(CapsuleSolid(0.08, 0.4), path=path)])
    truth = GroundTruth(ur10e, scene)
    for k in range(150):
        q = Q + 0.1 * np.sin(0.05 * k)
        found = truth(q, 0.01 * k)
        if k % 15 == 0:
            fresh = GroundTruth(ur10e, scene)(q, 0.01 * k)
            assert found.distance == pytest.approx(fresh.distance, abs=1e-12)
            assert found.link == fresh.link


@given(time=st.floats(-1.0, 3.0))
def test_known_points_move_as_fast_as_they_are_said_to(time: float) -> None:
    path = ((0.0, 0.9, 0.3, 0.5), (1.0, 0.7, -0.4, 0.9), (2.0, 0.7, -0.2, 0.9))
    moving = obstacle(Box((0.1, 0.2, 0.3)), path=path)
    cloud = KnownCloud(ObstacleScene([moving, obstacle(Sphere(0.1))]), 0.1)
    step = 1e-6
    if min(abs(time - stop[0]) for stop in path) < 2.0 * step:
        return
    speed = (cloud(time + step) - cloud(time - step)) / (2.0 * step)
    np.testing.assert_allclose(cloud.velocities(time), speed, atol=1e-8)
    assert len(cloud) == len(speed)
    assert not cloud.still


def test_a_moving_obstacle_is_seen_where_it_is_at_the_scans_stamp(ur10e: px.Robot) -> None:
    path = ((0.0, 1.2, 0.0, 0.9), (1.0, 0.9, 0.5, 0.9))
    world = World(ur10e, ObstacleScene([obstacle(Sphere(0.1), position=path[0][1:], path=path)]))
    for time, center in ((0.0, path[0][1:]), (0.5, (1.05, 0.25, 0.9)), (2.0, path[1][1:])):
        world.place(Q, time)
        origin = np.add(center, (0.0, 0.0, 1.0))
        down = np.array([[[0.0, 0.0, -1.0]]])
        assert world.cast(origin[None], down).length[0, 0] == pytest.approx(0.9, abs=1e-9)


@pytest.mark.parametrize("controller", ["wb", "wb_known"])
def test_a_trial_beside_what_moves_replays_bit_for_bit(
    ur10e: px.Robot, tmp_path: Path, controller: str
) -> None:
    path = "[[0.0,1.2,-0.29,0.6],[0.5,1.0,-0.29,0.6]]"
    moving = [f"obstacle.0.path={path}", "obstacle.0.position=[1.2,-0.29,0.6]", "duration=0.5"]
    scenario = load_scenario("front_plane", moving)
    with Recorder(tmp_path / "a.mcap") as recorder:
        log = run_trial(scenario, controller, robot=ur10e, recorder=recorder)
    recording = read_recording(tmp_path / "a.mcap")
    assert recording.damage is None
    assert first_difference(recording) is None
    assert log.true_m[-1] < log.true_m[0] - 0.15
    sparse = run_trial(scenario, controller, robot=ur10e, sparse_truth=True).summary()
    full = log.summary()
    assert {k: v for k, v in sparse.items() if k != "wall_s"} == {
        k: v for k, v in full.items() if k != "wall_s"
    }


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ("shape=\"cylinder\"", "size of a cylinder has 2 numbers"),
        ("path=[[1.0,1,2,3],[0.5,1,2,3]]", "path must go on in time"),
        ("path=[[0.0,9,9,9],[0.5,1,2,3]]", "path must begin at position"),
        ("shape=\"cone\"", "'box', 'cylinder', 'capsule' or 'sphere'"),
        ("size=[0.1,0.2,-0.3]", "must be greater than 0"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_an_obstacle_is_told(change: str, told: str) -> None:
    with pytest.raises(px.ConfigError, match=r"obstacle\.0") as raised:
        load_scenario("front_plane", [f"obstacle.0.{change}"])
    assert told in str(raised.value)


def test_a_pose_puts_roll_first() -> None:
    T = pose((1.0, 2.0, 3.0), (0.3, -0.4, 0.5))
    np.testing.assert_allclose(inverse(T) @ T, np.eye(4), atol=1e-15)


@solids
def test_the_box_that_bounds_true_distances_holds_all_that_stands_for_a_solid(solid: Solid) -> None:
    vertices_O, _ = solid.core()
    assert (np.abs(vertices_O) + solid.rounding <= half_box(solid)).all()
    assert half_box(solid) == pytest.approx(solid.extent, rel=2e-3)

"""Algorithms 1 and 2 of the paper, `fast` against `paper`, on real robots and real scans."""

import coal
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

import proxcgal as px


@pytest.fixture(scope="module", params=["ur10e", "panda"])
def robot(request):
    return px.load_robot(request.param)


def posture(robot, rng):
    low, high = np.maximum(robot.q_min, -np.pi), np.minimum(robot.q_max, np.pi)
    return rng.uniform(low, high)


def surface_points(robot, q, rng, n):
    """Middles of random faces of random links and their normals, in world, (n, 3) each."""
    points, normals = [], []
    poses = robot.link_poses(q)
    for link in rng.integers(len(robot.link_names), size=n):
        vertices, triangles = robot.mesh(int(link))
        a, b, c = vertices[triangles[rng.integers(len(triangles))]]
        normal = np.cross(b - a, c - a)
        points.append(poses[link, :3, :3] @ ((a + b + c) / 3) + poses[link, :3, 3])
        normals.append(poses[link, :3, :3] @ (normal / np.linalg.norm(normal)))
    return np.array(points), np.array(normals)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_fast_removes_what_the_paper_removes(robot, seed):
    rng = np.random.default_rng(seed)
    q = posture(robot, rng)
    points = surface_points(robot, q, rng, 200)[0] + rng.normal(0, 0.01, (200, 3))
    origins = points + rng.normal(0, 0.5, (200, 3))
    fast = px.remove_body(robot, q, origins, points, tolerance=0.02)
    paper = px.remove_body(robot, q, origins, points, tolerance=0.02, method="paper")
    np.testing.assert_array_equal(fast, paper)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 300))
def test_fast_finds_the_papers_distance(robot, seed, n):
    rng = np.random.default_rng(seed)
    q = posture(robot, rng)
    points = rng.uniform(-1.5, 1.5, (n, 3))
    fast = px.closest_pair(robot, q, points)
    paper = px.closest_pair(robot, q, points, method="paper")
    assert fast.distance == pytest.approx(paper.distance, abs=1e-9)
    assert (fast.link, fast.point) == (paper.link, paper.point)
    each = px.closest_pairs(robot, q, points)
    assert [p.link for p in each] == robot.link_names
    assert min(p.distance for p in each) == fast.distance


def test_a_point_between_sensor_and_body_is_kept(robot):
    # A ray that ends halfway to the link it would hit saw something else: Fig. 2 of the paper.
    rng = np.random.default_rng(3)
    q = posture(robot, rng)
    body, _ = surface_points(robot, q, rng, 100)
    origins = body + rng.normal(0, 0.4, (100, 3))
    half = origins + 0.5 * (body - origins)
    far = np.array([px.closest_pair(robot, q, p[None]).distance > 0.03 for p in half])
    assert far.sum() > 20
    assert px.remove_body(robot, q, origins[far], half[far]).all()


def test_a_point_on_any_link_is_removed_once_and_for_all(robot):
    # Read literally, Algorithm 1 adds a point again for every link that its ray misses.
    rng = np.random.default_rng(4)
    q = posture(robot, rng)
    body, normal = surface_points(robot, q, rng, 200)
    for method in ("fast", "paper"):
        kept = px.remove_body(robot, q, body + 1e-3 * normal, body, min_hit=0.0, method=method)
        assert not kept.any()


def test_mesh_distance_agrees_with_coal():
    robot = px.load_robot("ur10e")
    panel = trimesh.creation.box((1.0, 1.0, 0.02))
    tree = px.MeshTree(panel.vertices, panel.faces)
    box = coal.Box(1.0, 1.0, 0.02)
    rng = np.random.default_rng(5)
    models = []
    for name in robot.link_names:
        vertices, triangles = robot.mesh(name)
        model = coal.BVHModelOBBRSS()
        model.beginModel(len(triangles), len(vertices))
        model.addVertices(vertices)
        model.addTriangles(triangles.astype(np.int64))
        model.endModel()
        models.append(model)
    for _ in range(15):
        q = posture(robot, rng)
        pose = np.eye(4)
        pose[:3, 3] = rng.uniform([-1, -1, 0.5], [1, 1, 2.5])
        expected = np.inf
        for model, T in zip(models, robot.link_poses(q), strict=True):
            request, result = coal.DistanceRequest(), coal.DistanceResult()
            place = [coal.Transform3s(M[:3, :3], M[:3, 3]) for M in (T, pose)]
            d = coal.distance(model, place[0], box, place[1], request, result)
            expected = min(expected, max(d, 0.0))
        found = px.mesh_distance(robot, q, tree, pose).distance
        assert found == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda r: px.closest_pair(r, np.zeros(5), np.zeros((1, 3))), r"q has shape \(5,\)"),
        (lambda r: px.closest_pair(r, np.full(r.n_q, np.nan), np.zeros((1, 3))), "q is not finite"),
        (lambda r: px.closest_pair(r, np.zeros(r.n_q), np.zeros((0, 3))), "points_W is empty"),
        (lambda r: px.closest_pair(r, np.zeros(r.n_q), np.zeros(3)), r"points_W has shape \(3,\)"),
        (lambda r: px.closest_pair(r, np.zeros(r.n_q), [[np.nan] * 3]), "row 0 is not finite"),
        (lambda r: px.closest_pairs(r, np.zeros(r.n_q), np.zeros((0, 3))), "points_W is empty"),
        (
            lambda r: px.remove_body(r, np.zeros(r.n_q), np.zeros((2, 3)), np.zeros((1, 3))),
            "one origin for each point",
        ),
    ],
)
def test_bad_input_is_refused_by_name(robot, call, message):
    with pytest.raises(px.GeometryError, match=message):
        call(robot)


def test_an_unknown_method_is_refused_with_the_names(robot):
    with pytest.raises(px.ConfigError, match="method is 'quick', must be one of 'fast', 'paper'"):
        px.closest_pair(robot, np.zeros(robot.n_q), np.zeros((1, 3)), method="quick")

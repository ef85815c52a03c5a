"""Distances and rays against libigl, on real link meshes."""

import igl
import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

import proxcgal as px

ROBOTS = ["ur10e", "panda", "kr150"]


@pytest.fixture(scope="module", params=ROBOTS)
def robot(request):
    return px.load_robot(request.param)


def queries(rng, vertices, n):
    """Points near, on and far from a surface."""
    center, size = vertices.mean(0), np.ptp(vertices, 0).max()
    near = vertices[rng.integers(len(vertices), size=n // 2)] + rng.normal(0, 0.02, (n // 2, 3))
    return np.vstack([near, center + rng.uniform(-2 * size, 2 * size, (n - n // 2, 3))])


def test_closest_agrees_with_libigl(robot):
    rng = np.random.default_rng(0)
    for link in robot.link_names:
        vertices, triangles = robot.mesh(link)
        points = queries(rng, vertices, 600)
        distance, surface, triangle = robot.tree(link).closest(points)
        expected, *_ = igl.point_mesh_squared_distance(points, vertices, triangles.astype(np.int64))
        np.testing.assert_allclose(distance, np.sqrt(expected), rtol=0, atol=1e-9)
        np.testing.assert_allclose(np.linalg.norm(surface - points, axis=1), distance, atol=1e-9)
        assert triangle.min() >= 0
        assert triangle.max() < len(triangles)


def first_hits(vertices, triangles, origins, directions):
    """Every ray against every triangle (Moeller-Trumbore), in numpy."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    hits = np.full(len(origins), np.inf)
    for i, (o, d) in enumerate(zip(origins, directions, strict=True)):
        p = np.cross(d, c - a)
        det = np.einsum("ij,ij->i", b - a, p)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.einsum("ij,ij->i", o - a, p) / det
            q = np.cross(o - a, b - a)
            v = q @ d / det
            t = np.einsum("ij,ij->i", c - a, q) / det
        ok = (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0)
        if ok.any():
            hits[i] = t[ok].min() * np.linalg.norm(d)
    return hits


def test_first_hit_agrees_with_every_triangle_asked(robot):
    rng = np.random.default_rng(1)
    for link in robot.link_names:
        vertices, triangles = robot.mesh(link)
        origins = queries(rng, vertices, 100)
        directions = vertices[rng.integers(len(vertices), size=100)] - origins
        directions += rng.normal(0, 0.01, directions.shape)
        found = robot.tree(link).first_hit(origins, directions)
        expected = first_hits(vertices, triangles, origins, directions)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)


@given(st.integers(0, 2**32 - 1), st.floats(0.01, 10.0))
def test_distance_scales_with_the_scene(seed, scale):
    rng = np.random.default_rng(seed)
    vertices, triangles = rng.normal(size=(12, 3)), rng.integers(12, size=(20, 3))
    distinct = [len(set(t)) == 3 for t in triangles.tolist()]
    points = rng.normal(size=(10, 3))
    one = px.MeshTree(vertices, triangles[distinct]).closest(points)[0]
    scaled = px.MeshTree(vertices * scale, triangles[distinct]).closest(points * scale)[0]
    np.testing.assert_allclose(scaled, one * scale, rtol=1e-9, atol=1e-12)


def cube():
    box = trimesh.creation.box(bounds=[[0, 0, 0], [1, 1, 1]])
    return np.array(box.vertices), np.array(box.faces)


@pytest.mark.parametrize("kind", [np.int32, np.int64, np.uint16])
def test_triangles_may_have_any_integer_type(kind):
    vertices, triangles = cube()
    assert px.MeshTree(vertices, triangles.astype(kind)).closest([[0.5, 0.5, 3.0]])[0] == [2.0]


@pytest.mark.parametrize(
    ("vertices", "triangles", "message"),
    [
        (np.zeros((3, 2)), [[0, 1, 2]], r"vertices_L has shape \(3, 2\), expected \(n, 3\)"),
        (np.full((3, 3), np.nan), [[0, 1, 2]], "vertices_L row 0 is not finite"),
        (cube()[0], np.zeros((0, 3), int), "no triangle"),
        (cube()[0], [[0, 1, 8]], "triangle 0 uses vertex 8: allowed are 0 to 7"),
        (cube()[0], [[0, 1, -1]], "triangle 0 uses vertex -1"),
        (cube()[0], [[0, 1, 2**40]], "triangle 0 uses vertex"),
        (cube()[0], [[0.0, 1.0, 2.0]], "expected integers"),
        (cube()[0], [[0, 1]], r"expected \(f, 3\)"),
        (cube()[0], [[0, 0, 0]], "no triangle with area"),
        ("text", [[0, 1, 2]], "vertices_L is"),
    ],
)
def test_a_bad_mesh_is_refused_by_name(vertices, triangles, message):
    with pytest.raises(px.GeometryError, match=message):
        px.MeshTree(vertices, triangles)


def test_bad_queries_are_refused_by_name():
    tree = px.MeshTree(*cube())
    with pytest.raises(px.GeometryError, match="points_L row 1 is not finite"):
        tree.closest([[0, 0, 0], [np.inf, 0, 0]])
    with pytest.raises(px.GeometryError, match="directions_L row 0 is zero"):
        tree.first_hit([[0, 0, 0]], [[0, 0, 0]])
    with pytest.raises(px.GeometryError, match="one direction for each origin"):
        tree.first_hit([[0, 0, 0]], [[0, 0, 1], [0, 0, 1]])


def test_winding_number_agrees_with_libigl(robot):
    rng = np.random.default_rng(2)
    for link in robot.link_names:
        vertices, triangles = robot.mesh(link)
        points = queries(rng, vertices, 200)
        found = robot.tree(link).winding_number(points)
        expected = igl.winding_number(vertices, triangles.astype(np.int64), points)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)


def test_signed_distance_agrees_with_libigl_on_whole_robots(robot):
    rng = np.random.default_rng(3)
    q = rng.uniform(np.maximum(robot.q_min, -2.0), np.minimum(robot.q_max, 2.0))
    poses = robot.link_poses(q)
    corners = np.concatenate(
        [
            robot.mesh(n)[0] @ T[:3, :3].T + T[:3, 3]
            for n, T in zip(robot.link_names, poses, strict=True)
        ]
    )
    points = corners[rng.integers(len(corners), size=300)] + rng.normal(0, 0.03, (300, 3))
    found = px.signed_distance(robot, q, points)
    signed = []
    for name, T in zip(robot.link_names, poses, strict=True):
        vertices, triangles = robot.mesh(name)
        points_L = (points - T[:3, 3]) @ T[:3, :3]
        squared, *_ = igl.point_mesh_squared_distance(
            points_L, vertices, triangles.astype(np.int64)
        )
        around = np.abs(igl.winding_number(vertices, triangles.astype(np.int64), points_L))
        signed.append(np.sqrt(squared) * np.where(around > 0.5, -1.0, 1.0))
    np.testing.assert_allclose(found.distance, np.min(signed, axis=0), rtol=0, atol=1e-9)
    assert found.link == [robot.link_names[k] for k in np.argmin(signed, axis=0)]
    assert (found.distance < 0).sum() > 20
    # A step along the normal is a step out by its length.
    np.testing.assert_allclose(
        found.surface_W + found.distance[:, None] * found.normal_W, points, atol=1e-9
    )
    np.testing.assert_allclose(np.linalg.norm(found.normal_W, axis=1), 1.0, atol=1e-9)


def test_inside_a_convex_mesh_is_behind_all_of_its_faces():
    sphere = trimesh.creation.icosphere(subdivisions=3, radius=0.2)
    points = np.random.default_rng(4).uniform(-0.3, 0.3, (500, 3))
    around = px.MeshTree(sphere.vertices, sphere.faces).winding_number(points)
    corners = np.asarray(sphere.vertices)[sphere.faces[:, 0]]
    ahead = np.einsum("pfk,fk->pf", points[:, None] - corners, sphere.face_normals)
    inside = (ahead < 0).all(axis=1)
    np.testing.assert_allclose(around, inside, atol=1e-9)
    assert 50 < inside.sum() < 450

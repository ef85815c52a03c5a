"""The controller's meshes: the number of vertices asked for, the surface where it was."""

import warnings
from pathlib import Path

import igl
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

import proxcgal as px
from proxcgal.models.mesh.decimation import decimate
from proxcgal.models.mesh.resolution import control_mesh, subdivide
from proxcgal.models.mesh.shapes import box, cylinder, ellipsoid
from proxcgal.models.mesh.triangles import (
    compact,
    double_areas,
    edges_of,
    point_triangle_distance,
    sample,
)

Mesh = tuple[np.ndarray, np.ndarray]


def surface_points(mesh: Mesh, count: int = 40_000) -> np.ndarray:
    """Vertices and random points of a surface, drawn apart from the product's own samples."""
    v, f = mesh
    rng = np.random.default_rng(5)
    area = double_areas(v, f)
    face = rng.choice(len(f), count, p=area / area.sum())
    a, b = np.sqrt(rng.random((count, 1))), rng.random((count, 1))
    p = v[f[face]]
    return np.vstack([v, (1 - a) * p[:, 0] + a * (1 - b) * p[:, 1] + a * b * p[:, 2]])


def farthest(mesh: Mesh, other: Mesh) -> float:
    """Largest distance from points of one surface to the other, by libigl [m]."""
    square, _, _ = igl.point_mesh_squared_distance(
        surface_points(mesh), other[0], other[1].astype(np.int64)
    )
    return float(np.sqrt(square.max()))


@pytest.mark.parametrize("name", ["ur10e", "panda", "kr150"])
def test_1000_vertices_stay_within_2_mm_of_the_full_mesh_both_ways(name: str) -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        robot = px.load_robot(name)
    said = " ".join(str(w.message) for w in caught if issubclass(w.category, px.ModelWarning))
    for link in robot.link_names:
        own, full = robot.mesh(link), robot.full_mesh(link)
        worst = max(farthest(own, full), farthest(full, own))
        assert worst < 0.002, link
        assert worst < robot.mesh_error(link) + 0.0002, link
        if f"'{link}' {len(own[0])}" in said:
            assert len(own[0]) > 1100, link
        else:
            assert 900 <= len(own[0]) <= 1100, link


def test_built_in_arms_meet_the_default_resolution_without_a_warning() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error", px.ModelWarning)
        for name in ("ur10e", "panda"):
            px.load_robot(name)


def test_10000_vertices_are_met_with_the_surface_in_place() -> None:
    robot = px.load_robot("kr150", vertices_per_link=10_000)
    for link in robot.link_names:
        vertices, triangles = robot.mesh(link)
        assert abs(len(vertices) - 10_000) <= 1000
        assert len(compact(vertices, triangles)[0]) == len(vertices)
        assert robot.mesh_error(link) == 0
        assert farthest((vertices, triangles), robot.full_mesh(link)) < 1e-9


@pytest.mark.parametrize("link", ["link5", "link6"])
def test_infinite_deviation_holds_to_the_count_and_leaves_no_spike(link: str) -> None:
    robot = px.load_robot("panda", vertices_per_link=None)
    mesh = control_mesh(*robot.full_mesh(link), 100, np.inf)
    assert abs(len(mesh.vertices_L) - 100) <= 10
    assert 0 < mesh.deviation < 0.01
    made = mesh.vertices_L, mesh.triangles
    assert farthest(made, robot.full_mesh(link)) < 0.01


def test_more_vertices_are_kept_where_2_mm_ask_for_them_and_it_is_said(tmp_path: Path) -> None:
    path = tmp_path / "r.urdf"
    path.write_text(
        '<robot name="ball"><link name="a"/><link name="b"><visual><geometry>'
        '<sphere radius="0.1"/></geometry></visual></link><joint name="j" type="continuous">'
        '<parent link="a"/><child link="b"/><limit velocity="1" effort="1"/></joint></robot>'
    )
    with pytest.warns(px.ModelWarning, match=r"'ball': more than 50 vertices .* 'b' \d+ \(dev"):
        robot = px.load_robot(path, vertices_per_link=50)
    assert len(robot.mesh("b")[0]) > 60
    assert robot.mesh_error("b") <= 0.002


def test_every_part_of_a_link_survives_decimation() -> None:
    # A screw of 4 mm beside a tube of 1 m.
    tube, screw = subdivide(*cylinder(0.05, 0.5), 1000), cylinder(0.002, 0.004)
    v = np.vstack([tube[0], screw[0] + [0.2, 0, 0]])
    f = np.vstack([tube[1], screw[1] + len(tube[0])])
    w, g = decimate(v, f, 150, 0.0018)
    assert (w[:, 0] > 0.19).any()
    assert max(farthest((v, f), (w, g)), farthest((w, g), (v, f))) < 0.002


def test_a_rim_stays_a_rim() -> None:
    v, f = subdivide(*cylinder(0.05, 0.4), 3000)
    open_end = ~(np.abs(v[f][:, :, 2] - 0.2) < 1e-9).all(axis=1)
    v, f = compact(v, f[open_end])
    w, g = decimate(v, f, 200, 0.001)
    assert w[:, 2].max() == pytest.approx(0.2, abs=1e-6)
    edges, faces = edges_of(g, len(w))
    assert set(faces) == {1, 2}
    np.testing.assert_allclose(w[edges[faces == 1].ravel(), 2], 0.2, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(w[edges[faces == 1].ravel(), :2], axis=1), 0.05,
                               atol=0.001)  # fmt: skip


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2), st.integers(70, 900))
def test_subdivision_gives_the_very_count_and_opens_no_gap(shape: int, count: int) -> None:
    v, f = [box(np.array([1.0, 0.2, 0.1])), cylinder(0.1, 1.0), box(np.ones(3))][shape]
    count = max(count, len(v))
    w, g = subdivide(v, f, count)
    assert len(w) == count
    np.testing.assert_array_equal(w[: len(v)], v)
    assert set(edges_of(g, len(w))[1]) == {2}
    assert double_areas(w, g).sum() == pytest.approx(double_areas(v, f).sum())


def test_subdivision_takes_the_longest_edges_first() -> None:
    v, f = subdivide(*box(np.array([1.0, 0.1, 0.1])), 200)
    edges, _ = edges_of(f, len(v))
    assert np.linalg.norm(v[edges[:, 0]] - v[edges[:, 1]], axis=1).max() < 0.126


def test_distance_to_a_triangle_agrees_with_libigl() -> None:
    rng = np.random.default_rng(0)
    corners = rng.normal(size=(2000, 3, 3))
    corners[:50, 2] = corners[:50, 1]  # needles too
    points = rng.normal(size=(2000, 3))
    own = point_triangle_distance(points, corners)
    for k in range(0, 2000, 7):
        square, _, _ = igl.point_mesh_squared_distance(
            points[k : k + 1], corners[k], np.array([[0, 1, 2]])
        )
        assert own[k] == pytest.approx(float(np.sqrt(square[0])), abs=1e-9)


def test_samples_lie_on_the_surface_and_leave_no_hole() -> None:
    v, f = ellipsoid(np.array([0.1, 0.2, 0.3]))
    points, on = sample(v, f, 0.01)
    assert point_triangle_distance(points, v[f[on]]).max() < 1e-12
    gaps, _ = cKDTree(points).query(surface_points((v, f)))
    assert gaps.max() < 0.02

"""Capsules: distances against coal and exact fractions, capsules for links, robots made of them."""

from fractions import Fraction
from itertools import product
from pathlib import Path

import coal
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import proxcgal as px
from proxcgal.core.errors import ModelError
from proxcgal.models.builtin import ga_ol
from proxcgal.models.capsule_fit import fit_capsule, fit_capsules
from proxcgal.models.formats.capsule_robot import read_capsule_robot
from proxcgal.models.mesh.shapes import capsule_between

Point = tuple[int, int, int]


def random_capsules(generator: np.random.Generator, count: int) -> np.ndarray:
    rows = generator.uniform(-1.0, 1.0, (count, 7))
    rows[:, 3:6] = rows[:, :3] + rows[:, 3:6] * 10.0 ** generator.uniform(-3, 0, (count, 1))
    rows[:, 6] = generator.uniform(0.01, 0.3, count)
    return rows


def coal_distances(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    def placed(row: np.ndarray) -> tuple[coal.Capsule, coal.Transform3s]:
        along = row[3:6] - row[:3]
        length = float(np.linalg.norm(along))
        z = along / length
        x = np.cross(np.eye(3)[np.abs(z).argmin()], z)
        x /= np.linalg.norm(x)
        R = np.stack([x, np.cross(z, x), z], axis=1)
        return coal.Capsule(row[6], length), coal.Transform3s(R, 0.5 * (row[:3] + row[3:6]))

    request, found = coal.DistanceRequest(), np.empty(len(a))
    for k, (one, other) in enumerate(zip(a, b, strict=True)):
        result = coal.DistanceResult()
        found[k] = coal.distance(*placed(one), *placed(other), request, result)
    return found


@pytest.mark.parametrize(
    "count", [10_000, pytest.param(1_000_000, marks=pytest.mark.long)], ids=["short", "long"]
)
def test_distance_agrees_with_coal(count: int) -> None:
    generator = np.random.default_rng(1)
    for start in range(0, count, 10_000):
        size = min(10_000, count - start)
        a, b = random_capsules(generator, size), random_capsules(generator, size)
        apart = np.abs(px.capsule_distances(a, b) - coal_distances(a, b))
        assert apart.max() < 1e-9, start


def exact_squared(a: tuple[Point, Point], b: tuple[Point, Point]) -> Fraction:
    """Least squared distance of two segments, in fractions: no rounding at all."""
    (p, q), (r, s) = a, b
    u, v, w = (
        [Fraction(y - x) for x, y in zip(one, other, strict=True)]
        for one, other in ((p, q), (r, s), (r, p))
    )

    def dot(x: list[Fraction], y: list[Fraction]) -> Fraction:
        return sum((i * j for i, j in zip(x, y, strict=True)), Fraction(0))

    def at(s_: Fraction, t_: Fraction) -> Fraction:
        d = [w[i] + s_ * u[i] - t_ * v[i] for i in range(3)]
        return dot(d, d)

    def clamp(x: Fraction) -> Fraction:
        return min(max(x, Fraction(0)), Fraction(1))

    uu, vv, uv, uw, vw = dot(u, u), dot(v, v), dot(u, v), dot(u, w), dot(v, w)
    found = []
    for share in (Fraction(0), Fraction(1)):
        found.append(at(share, clamp((vw + share * uv) / vv) if vv else Fraction(0)))
        found.append(at(clamp((share * uv - uw) / uu) if uu else Fraction(0), share))
    determinant = uu * vv - uv * uv
    if determinant:
        s_, t_ = (uv * vw - vv * uw) / determinant, (uu * vw - uv * uw) / determinant
        if 0 <= s_ <= 1 and 0 <= t_ <= 1:
            found.append(at(s_, t_))
    return min(found)


coordinate = st.integers(-3, 3)
point = st.tuples(coordinate, coordinate, coordinate)


@given(point, point, point, point)
def test_distance_is_exact_for_small_whole_numbers(p: Point, q: Point, r: Point, s: Point) -> None:
    """Points, parallels, crossings and identical segments are common among these."""
    rows = np.array([[*p, *q, 0.0]], np.float64), np.array([[*r, *s, 0.0]], np.float64)
    expected = float(exact_squared((p, q), (r, s))) ** 0.5
    assert px.capsule_distances(*rows)[0] == pytest.approx(expected, abs=1e-14)


@given(point, point, point, point)
def test_distance_is_the_same_whichever_way_it_is_asked(
    p: Point, q: Point, r: Point, s: Point
) -> None:
    ways = [
        px.closest_capsules(px.Capsule(a, b, 0.1), px.Capsule(c, d, 0.2)).distance
        for (a, b), (c, d) in (
            *product(((p, q), (q, p)), ((r, s), (s, r))),
            *product(((r, s), (s, r)), ((p, q), (q, p))),
        )
    ]
    assert np.ptp(ways) < 1e-14


def test_bad_capsules_are_told() -> None:
    with pytest.raises(px.GeometryError, match="radius is -1"):
        px.Capsule([0, 0, 0], [1, 0, 0], -1.0)
    with pytest.raises(px.GeometryError, match="row 0"):
        px.capsule_distances(np.full((1, 7), np.nan), np.zeros((1, 7)))


def outside(capsule: px.Capsule, points: np.ndarray) -> float:
    """How far the farthest of the points is outside."""
    along = capsule.end - capsule.start
    share = np.clip((points - capsule.start) @ along / max(along @ along, 1e-300), 0.0, 1.0)
    nearest = capsule.start + share[:, None] * along
    return float(np.linalg.norm(points - nearest, axis=1).max() - capsule.radius)


def test_fitted_capsules_contain_the_meshes_of_the_ur10e() -> None:
    robot = px.load_robot("ur10e")
    for capsule in fit_capsules(robot):
        vertices, triangles = robot.full_mesh(capsule.name)
        corners = vertices[triangles]
        samples = np.concatenate([vertices, corners.mean(axis=1), corners[:, :2].mean(axis=1)])
        assert outside(capsule.shape_L, samples) <= 0.0
        box = np.ptp(vertices, axis=0)
        assert 2 * capsule.shape_L.radius < np.linalg.norm(box)


def test_a_capsules_own_mesh_is_fitted_by_that_capsule() -> None:
    start, end = np.array([0.1, 0.2, 0.3]), np.array([0.5, -0.2, 0.9])
    found = fit_capsule(capsule_between(start, end, 0.1)[0])
    assert found.radius == pytest.approx(0.1, rel=0.02)
    ends = {tuple(np.round(p, 1)) for p in (found.start, found.end)}
    assert ends == {tuple(np.round(p, 1)) for p in (start, end)}


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1), st.integers(1, 40))
def test_any_points_are_contained(seed: int, count: int) -> None:
    points = np.random.default_rng(seed).normal(size=(count, 3))
    assert outside(fit_capsule(points), points) <= 0.0


@pytest.mark.parametrize("length", [0.0, 0.7])
def test_a_capsules_mesh_is_closed_and_lies_on_it(length: float) -> None:
    import trimesh

    start, end = np.array([0.1, 0.0, 0.2]), np.array([0.1, length, 0.2])
    vertices, triangles = capsule_between(start, end, 0.15)
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    assert mesh.is_watertight
    ideal = np.pi * 0.15**2 * (length + 4 / 3 * 0.15)
    assert mesh.volume == pytest.approx(ideal, rel=0.03)
    along = np.clip(vertices[:, 1], 0.0, length)
    apart = np.linalg.norm(
        vertices - np.stack([0 * along + 0.1, along, 0 * along + 0.2], 1), axis=1
    )
    np.testing.assert_allclose(apart, 0.15, atol=1e-12)


def test_ga_ol_has_the_papers_radii_and_limits() -> None:
    robot = px.load_robot("ga_ol")
    radii = [link.shape_L.radius for link in ga_ol().capsules()]
    assert radii == [0.25, 0.20, 0.10, 0.075, 0.05, 0.05, 0.075]
    np.testing.assert_allclose(np.degrees(robot.qd_max), [200, 200, 200, 300, 300, 300])
    np.testing.assert_allclose(np.degrees(robot.qdd_max), [450] * 6)


def test_each_capsule_of_ga_ol_ends_where_the_next_begins() -> None:
    robot, arm = px.load_robot("ga_ol"), ga_ol()
    q = np.array([0.3, 0.2, -0.4, 0.7, 0.5, -1.1])
    poses = robot.link_poses(q)
    for row, (one, after) in enumerate(zip(arm.links, arm.links[1:], strict=False)):
        end = poses[row] @ [*one.end, 1.0]
        start = poses[row + 1] @ [*after.start, 1.0]
        np.testing.assert_allclose(end, start, atol=1e-12)
    tool = poses[-1] @ [*arm.links[-1].end, 1.0]
    np.testing.assert_allclose(robot.tool_pose(q)[:3, 3], tool[:3], atol=1e-12)


def test_a_robot_is_read_from_a_users_list_of_capsules(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    path.write_text(_ARM)
    robot = px.load_robot(path)
    assert (robot.name, robot.joint_names, robot.link_names) == ("arm", ["turn"], ["one", "two"])
    np.testing.assert_allclose(robot.tool_pose(np.array([np.pi / 2]))[:3, 3], [0, 0.9, 0.1],
                               atol=1e-12)  # fmt: skip


def test_all_that_is_wrong_with_a_list_of_capsules_is_told(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    path.write_text(_ARM.replace("radius = 0.1", "radius = -0.1").replace("mass", "weight"))
    with pytest.raises(ModelError) as caught:
        read_capsule_robot(path)
    assert "link.0.radius" in str(caught.value)
    assert "link.1.weight" in str(caught.value)
    assert str(caught.value).count(str(path)) == len(str(caught.value).splitlines())


_ARM = """
name = "arm"
[tool]
link = "two"
position = [0.4, 0.0, 0.0]
[[link]]
name = "one"
joint = "turn"
origin = [0.0, 0.0, 0.1]
speed = 1.0
start = [0.0, 0.0, 0.0]
end = [0.5, 0.0, 0.0]
radius = 0.1
[[link]]
name = "two"
origin = [0.5, 0.0, 0.0]
start = [0.0, 0.0, 0.0]
end = [0.4, 0.0, 0.0]
radius = 0.05
mass = 2.0
"""

"""Rings of sensors: on the link's own surface, round it, looking away from it."""

from pathlib import Path

import igl
import numpy as np
import pytest

import proxcgal as px
from proxcgal.models.mesh.shapes import cylinder

STANDOFF = 0.01
RINGS = [
    ("ur10e", "forearm_link", 0.2), ("ur10e", "forearm_link", 0.5), ("ur10e", "forearm_link", 0.8),
    ("ur10e", "upper_arm_link", 0.5), ("panda", "link1", 0.5), ("panda", "link2", 0.5),
    ("panda", "link7", 0.5), ("kr150", "link_2", 0.5),
]  # fmt: skip


@pytest.fixture(scope="module")
def robots() -> dict[str, px.Robot]:
    names = ("ur10e", "panda", "kr150")
    return {name: px.load_robot(name, vertices_per_link=None) for name in names}


def poses(skin: px.Skin) -> np.ndarray:
    return np.array([mount.T_LS for mount in skin.mounts])


@pytest.mark.parametrize(("name", "link", "at"), RINGS)
def test_sensors_stand_on_the_outer_surface_and_look_away_from_it(
    robots: dict[str, px.Robot], name: str, link: str, at: float
) -> None:
    robot = robots[name]
    T = poses(px.ring_skin(robot, link, at=at, sensors=10, standoff=STANDOFF))
    vertices, triangles = robot.full_mesh(link)
    foot = T[:, :3, 3] - STANDOFF * T[:, :3, 2]
    square, _, _ = igl.point_mesh_squared_distance(foot, vertices, triangles.astype(np.int64))
    assert np.sqrt(square.max()) < 1e-9
    # Nothing of the link is in front of a sensor, and none is deeper than its standoff.
    tree = robot.tree(link)
    assert np.isinf(tree.first_hit(T[:, :3, 3], T[:, :3, 2])).all()
    distance, _, _ = tree.closest(T[:, :3, 3])
    assert (distance > 0.3 * STANDOFF).all()
    assert (distance < STANDOFF + 1e-9).all()


@pytest.mark.parametrize(("name", "link", "at"), RINGS)
def test_sensor_frames_are_rotations_even_in_angle_round_one_axis(
    robots: dict[str, px.Robot], name: str, link: str, at: float
) -> None:
    T = poses(px.ring_skin(robots[name], link, at=at, sensors=12))
    R = T[:, :3, :3]
    np.testing.assert_allclose(np.einsum("nij,nkj->nik", R, R), np.tile(np.eye(3), (12, 1, 1)),
                               atol=1e-12)  # fmt: skip
    np.testing.assert_allclose(np.linalg.det(R), 1)
    assert np.ptp(R[:, :, 0], axis=0).max() < 1e-12  # x is the link's axis for all
    after = np.roll(R[:, :, 2], -1, axis=0)
    np.testing.assert_allclose(np.einsum("ni,ni->n", R[:, :, 2], after), np.cos(np.pi / 6))
    turn = np.einsum("ni,ni->n", np.cross(R[:, :, 2], after), R[:, :, 0])
    np.testing.assert_allclose(turn, np.sin(np.pi / 6))
    height = np.einsum("ni,ni->n", T[:, :3, 3], R[:, :, 0])
    assert np.ptp(height) < 1e-12  # one plane across the axis


def test_fractions_run_from_the_end_nearer_to_the_joint(robots: dict[str, px.Robot]) -> None:
    robot = robots["ur10e"]
    skin = px.ring_skin(robot, "forearm_link", at=(0.2, 0.5, 0.8), sensors=10)
    assert len(skin) == 30
    assert skin.mounts[13].name == "forearm_link/ring1/3"
    assert {mount.link for mount in skin.mounts} == {"forearm_link"}
    T = poses(skin)
    vertices, _ = robot.full_mesh("forearm_link")
    low, high = vertices[:, 2].min(), vertices[:, 2].max()
    for ring, fraction in enumerate((0.2, 0.5, 0.8)):
        np.testing.assert_allclose(T[10 * ring : 10 * ring + 10, 2, 3],
                                   low + fraction * (high - low), atol=1e-12)  # fmt: skip


@pytest.mark.shared
def test_a_ring_sits_in_the_same_place_on_the_users_own_ur10e(
    robots: dict[str, px.Robot], shared_robots: Path
) -> None:
    user = px.load_robot(shared_robots / "ur_description/urdf/ur10e.urdf", vertices_per_link=None)
    q = np.array([0.3, -1.2, 1.5, -0.4, 0.9, 0.1])
    world = []
    for robot in (robots["ur10e"], user):
        row = robot.link_names.index("forearm_link")
        world.append(robot.link_poses(q)[row] @ poses(px.ring_skin(robot, "forearm_link")))
    np.testing.assert_allclose(world[0], world[1], atol=1e-3)


def test_phase_turns_the_ring(robots: dict[str, px.Robot]) -> None:
    still = poses(px.ring_skin(robots["ur10e"], "forearm_link", at=0.5, sensors=4))
    turned = poses(
        px.ring_skin(robots["ur10e"], "forearm_link", at=0.5, sensors=4, phase=np.pi / 2)
    )
    np.testing.assert_allclose(turned, np.roll(still, -1, axis=0), atol=1e-9)


def test_rings_join_and_carry_their_model(robots: dict[str, px.Robot]) -> None:
    model = px.SensorModel(max_range=2.0)
    skins = [
        px.ring_skin(robots["panda"], link, at=0.5, model=model)
        for link in ("link1", "link2", "link7")
    ]
    skin = skins[0] + skins[1] + skins[2]
    assert len(skin) == 30
    assert skin.model.max_range == 2.0


def test_a_flat_link_is_ringed_round_its_short_side(robots: dict[str, px.Robot]) -> None:
    along = poses(px.ring_skin(robots["panda"], "link7", at=0.5))[:, :3, 0]
    np.testing.assert_array_equal(along, np.tile([0, 0, 1], (10, 1)))
    along = poses(px.ring_skin(robots["panda"], "link7", at=0.5, axis="x"))[:, :3, 0]
    assert (np.abs(along) == [1, 0, 0]).all()


def test_the_outermost_surface_counts_not_a_wall_inside(robots: dict[str, px.Robot]) -> None:
    outer, inner = cylinder(0.2, 1.0), cylinder(0.15, 0.9)
    v = np.vstack([outer[0], inner[0]])
    f = np.vstack([outer[1], inner[1] + len(outer[0])])
    robot = px.attach_mesh(robots["ur10e"], "wrist_3_link", (v, f))
    T = poses(px.ring_skin(robot, "wrist_3_link", at=0.5, sensors=8, standoff=0.0))
    radius = np.linalg.norm(T[:, :2, 3], axis=1)
    assert (radius > 0.199).all()


@pytest.mark.parametrize(
    ("settings", "error", "said"),
    [
        ({"link": "hand"}, px.ModelError, "no link 'hand'.*'forearm_link'"),
        ({"at": 1.5}, px.GeometryError, r"ring at 1.5 of link 'forearm_link'; 0 to 1"),
        ({"at": (0.5, -0.1)}, px.GeometryError, "ring at -0.1"),
        ({"at": float("nan")}, px.GeometryError, "ring at nan"),
        ({"at": ()}, px.GeometryError, "0 rings of 10 sensors"),
        ({"sensors": 0}, px.GeometryError, "1 rings of 0 sensors"),
        ({"sensors": float("nan")}, px.GeometryError, "1 rings of nan sensors"),
        ({"at": "half"}, px.GeometryError, "at = 'half'"),
        ({"standoff": 1e300}, px.GeometryError, "standoff = 1e\\+300 m"),
        ({"standoff": -0.01}, px.GeometryError, "standoff = -0.01"),
        ({"axis": "w"}, px.ConfigError, "axis = 'w'; one of x, y, z"),
        ({"at": 0.0}, px.GeometryError, "no surface"),
    ],
)
def test_rings_that_cannot_be_are_refused(
    robots: dict[str, px.Robot], settings: dict[str, object], error: type[Exception], said: str
) -> None:
    with pytest.raises(error, match=said):
        px.ring_skin(robots["ur10e"], **{"link": "forearm_link", "at": 0.5} | settings)

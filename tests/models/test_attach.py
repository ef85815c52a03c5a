"""Bodies put on a link, and two robots made one."""

from pathlib import Path

import numpy as np
import pytest

import proxcgal as px
from proxcgal.models.mesh.shapes import box, ellipsoid


@pytest.fixture(scope="module")
def ur10e() -> px.Robot:
    return px.load_robot("ur10e", vertices_per_link=None)


@pytest.fixture(scope="module")
def kr150() -> px.Robot:
    return px.load_robot("kr150", vertices_per_link=None)


def shift(x: float, y: float, z: float) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


def test_a_gripper_is_in_both_meshes_of_its_link_and_nowhere_else(ur10e: px.Robot) -> None:
    gripper = box(np.array([0.1, 0.1, 0.2]))
    robot = px.attach_mesh(ur10e, "wrist_3_link", gripper, shift(0, 0.3, 0))
    for mesh in (robot.mesh, robot.full_mesh):
        vertices, triangles = mesh("wrist_3_link")
        assert vertices[:, 1].max() == pytest.approx(0.35)
        assert len(triangles) == len(ur10e.full_mesh("wrist_3_link")[1]) + 12
    assert ur10e.full_mesh("wrist_3_link")[0][:, 1].max() < 0.2  # the old robot is as it was
    changed = {name for name in robot.link_names
               if robot.mesh_hashes[name] != ur10e.mesh_hashes[name]}  # fmt: skip
    assert changed == {"wrist_3_link"}


def test_the_nearest_point_may_be_on_the_gripper(ur10e: px.Robot) -> None:
    q = np.zeros(6)
    tip_W = (ur10e.tool_pose(q) @ [0, 0, 0.3, 1])[:3]
    alone = px.closest_pair(ur10e, q, tip_W[None])
    held = px.attach_mesh(ur10e, "wrist_3_link", box(np.array([0.05, 0.5, 0.05])))
    with_it = px.closest_pair(held, q, tip_W[None])
    assert with_it.distance < alone.distance - 0.05
    assert with_it.link == "wrist_3_link"


def test_a_gripper_comes_from_a_file_and_is_coarsened(tmp_path: Path, ur10e: px.Robot) -> None:
    import trimesh

    path = tmp_path / "ball.stl"
    trimesh.creation.icosphere(subdivisions=4, radius=0.1).export(path)
    robot = px.attach_mesh(ur10e, "wrist_3_link", path, vertices=500)
    added = len(robot.mesh("wrist_3_link")[0]) - len(ur10e.mesh("wrist_3_link")[0])
    full = len(robot.full_mesh("wrist_3_link")[0]) - len(ur10e.full_mesh("wrist_3_link")[0])
    assert (added, full) == (500, 2562)
    assert 0 < robot.mesh_error("wrist_3_link") <= 0.002


@pytest.mark.parametrize(
    ("link", "mesh", "pose", "error", "said"),
    [
        ("wrist_9_link", box(np.ones(3)), None, px.ModelError, "no link 'wrist_9_link'.*'wrist_3_"),
        ("wrist_3_link", "nothing.stl", None, px.GeometryError, "nothing.stl: cannot be read"),
        ("wrist_3_link", box(np.ones(3)), np.ones((4, 4)), px.ModelError, "a rotation and a trans"),
        ("wrist_3_link", box(np.ones(3)), np.eye(3), px.ModelError, r"finite \(4, 4\) pose"),
        ("wrist_3_link", (np.zeros((3, 3)), np.array([[0, 1, 3]])), None, px.GeometryError,
         "face 0 has vertex 3; there are 3"),
        ("wrist_3_link", (np.full((3, 3), np.nan), np.array([[0, 1, 2]])), None, px.GeometryError,
         "vertex 0 is"),
        ("wrist_3_link", (np.zeros((3, 3)), np.zeros((0, 3), dtype=int)), None, px.GeometryError,
         "no triangles"),
        ("wrist_3_link", (np.eye(3), np.array([[0.0, 1.0, 2.0]])), None, px.GeometryError,
         "integers are needed"),
    ],
)  # fmt: skip
def test_what_cannot_be_attached_is_refused(
    ur10e: px.Robot, link: str, mesh: object, pose: object, error: type[Exception], said: str
) -> None:
    with pytest.raises(error, match=said):
        px.attach_mesh(ur10e, link, mesh, pose)


def test_two_arms_become_one_chain(ur10e: px.Robot, kr150: px.Robot) -> None:
    both = px.attach(kr150, "tool0", ur10e, np.eye(4), ("kuka_", "ur10e_"))
    assert both.n_q == 12
    assert both.joint_names[5:7] == ["kuka_joint_a6", "ur10e_shoulder_pan_joint"]
    assert both.link_names[0] == "kuka_base_link"
    assert {"kuka_link_6", "ur10e_base_link", "ur10e_wrist_3_link"} < set(both.link_names)
    assert both.tool == "ur10e_tool0"
    np.testing.assert_array_equal(both.qd_max, np.r_[kr150.qd_max, ur10e.qd_max])
    rng = np.random.default_rng(4)
    for q in rng.uniform(-1, 1, (50, 12)):
        flange = kr150.tool_pose(q[:6])
        np.testing.assert_allclose(both.tool_pose(q), flange @ ur10e.tool_pose(q[6:]), atol=1e-12)
        poses = dict(zip(both.link_names, both.link_poses(q), strict=True))
        own = zip(ur10e.link_names, ur10e.link_poses(q[6:]), strict=True)
        for name, pose in own:
            np.testing.assert_allclose(poses[f"ur10e_{name}"], flange @ pose, atol=1e-12)
        own = zip(kr150.link_names, kr150.link_poses(q[:6]), strict=True)
        for name, pose in own:
            np.testing.assert_allclose(poses[f"kuka_{name}"], pose, atol=1e-12)


def test_two_arms_move_each_other_as_one_chain_does(ur10e: px.Robot, kr150: px.Robot) -> None:
    both = px.attach(kr150, "link_6", ur10e, shift(0.1, 0, 0), "ur_")
    q = np.random.default_rng(5).uniform(-1, 1, 12)
    J = both.jacobian(q, "ur_wrist_3_link", both.tool_pose(q)[:3, 3])
    step = 1e-6
    for joint in range(12):
        d = np.zeros(12)
        d[joint] = step
        moved = both.tool_pose(q + d)[:3, 3] - both.tool_pose(q - d)[:3, 3]
        np.testing.assert_allclose(J[:3, joint], moved / (2 * step), atol=1e-7)
    assert not both.moves("ur_elbow_joint", "link_6")
    assert both.moves("joint_a1", "ur_forearm_link")


def test_robots_whose_names_meet_need_prefixes(ur10e: px.Robot, kr150: px.Robot) -> None:
    with pytest.raises(px.ModelError, match="both robots have link 'base_link'"):
        px.attach(kr150, "tool0", ur10e, np.eye(4), "")
    with pytest.raises(px.ModelError, match="both robots have joint 'shoulder_pan_joint'"):
        px.attach(ur10e, "tool0", ur10e, np.eye(4), "")
    three = px.attach(
        px.attach(ur10e, "tool0", ur10e, np.eye(4), "b_"), "b_tool0", ur10e, np.eye(4), "c_"
    )
    assert three.n_q == 18
    with pytest.raises(px.ModelError, match="no frame 'nowhere'"):
        px.attach(kr150, "nowhere", ur10e, np.eye(4), "ur_")


def test_control_meshes_are_taken_over_as_they_are(kr150: px.Robot) -> None:
    coarse = px.load_robot("ur10e")
    both = px.attach(kr150, "tool0", coarse, np.eye(4), "ur_")
    for link in coarse.link_names:
        np.testing.assert_array_equal(both.mesh(f"ur_{link}")[0], coarse.mesh(link)[0])
        assert both.mesh_error(f"ur_{link}") == coarse.mesh_error(link)


def test_a_full_mesh_is_never_the_coarse_one() -> None:
    robot = px.attach_mesh(px.load_robot("ur10e"), "forearm_link", ellipsoid(np.full(3, 0.05)))
    assert len(robot.full_mesh("forearm_link")[0]) > 5 * len(robot.mesh("forearm_link")[0])


@pytest.mark.parametrize(
    ("pose", "prefix", "said"),
    [
        ("abc", "x_", "pose = abc; a finite"),
        (np.eye(3), "x_", "pose has shape"),
        (np.full((4, 4), np.nan), "x_", "pose holds NaN"),
        (np.eye(4), 3, "prefix = 3; a text, or two"),
        (np.eye(4), ("a", "b", "c"), "prefix = .*; a text, or two"),
    ],
)
def test_what_no_robot_can_be_hung_by_is_told(
    ur10e: px.Robot, pose: object, prefix: object, said: str
) -> None:
    with pytest.raises(px.ModelError, match=said):
        px.attach(ur10e, "tool0", ur10e, pose, prefix)  # type: ignore[arg-type]


def test_what_is_no_robot_is_told_by_the_arguments_name() -> None:
    with pytest.raises(px.ModelError, match="robot = 'ur10e': a Robot is needed"):
        px.attach("ur10e", "tool0", px.load_robot("ur10e"), np.eye(4), "x_")  # type: ignore[arg-type]

"""A robot is the same robot as URDF, as xacro and as MJCF; and as it is by hand."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from random_robots import RandomRobot
from scipy.spatial import cKDTree

import proxcgal as px


def surface(robot: px.Robot, q: np.ndarray) -> dict[str, tuple[np.ndarray, float]]:
    """Vertices in the world and area of each link."""
    found = {}
    for link, T in zip(robot.link_names, np.asarray(robot.link_poses(q)), strict=True):
        v, f = robot.full_mesh(link)
        a, b, c = (v[f[:, k]] for k in range(3))
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
        found[link] = (v @ T[:3, :3].T + T[:3, 3], float(area))
    return found


def check(seed: int, folder: Path) -> None:
    """Kinematics and limits to 1e-9, surfaces to 1e-6 m."""
    random = RandomRobot(seed)
    files = random.write(folder)
    tool = f"l{len(random.bodies) - 1}"
    robots = {
        kind: px.load_robot(
            path, tool=tool, base="l0", vertices_per_link=None,
            speed_limits=None if kind != "xml" else 1.0,
            xacro_args={"speed_factor": 1} if kind == "xacro" else None,
        )
        for kind, path in files.items()
    }  # fmt: skip
    names = [f"j{row}" for row in random.moving]
    model = mujoco.MjModel.from_xml_path(str(files["xml"]))
    data = mujoco.MjData(model)
    for kind, robot in robots.items():
        assert sorted(robot.joint_names) == sorted(names), kind
        low, high = zip(*(random.bodies[int(j[1:])].limits for j in robot.joint_names), strict=True)
        np.testing.assert_allclose(robot.q_min, low, atol=1e-9)
        np.testing.assert_allclose(robot.q_max, high, atol=1e-9)
        if kind != "xml":
            speeds = [random.bodies[int(j[1:])].speed for j in robot.joint_names]
            np.testing.assert_allclose(robot.qd_max, speeds, atol=1e-9)
    rng = np.random.default_rng(seed)
    for _ in range(3):
        q = {name: float(rng.uniform(*random.bodies[int(name[1:])].limits)) for name in names}
        poses = random.poses(q)
        for name, value in q.items():
            data.joint(name).qpos[0] = value
        mujoco.mj_kinematics(model, data)
        in_order = {k: np.array([q[j] for j in r.joint_names]) for k, r in robots.items()}
        right = surface(robots["urdf"], in_order["urdf"])
        for kind, robot in robots.items():
            found = np.asarray(robot.tool_pose(in_order[kind]))
            # Bodies of the MJCF have frames of their own.
            expected = poses[-1] @ (random.own[-1] if kind == "xml" else np.eye(4))
            np.testing.assert_allclose(found, expected, atol=1e-9)
            for link, T in zip(robot.link_names, robot.link_poses(in_order[kind]), strict=True):
                row = int(link[1:])
                own = random.own[row] if kind == "xml" else np.eye(4)
                np.testing.assert_allclose(T, poses[row] @ own, atol=1e-9)
            there = surface(robot, in_order[kind])
            assert there.keys() == right.keys()
            for link, (vertices, area) in there.items():
                other, its_area = right[link]
                assert area == pytest.approx(its_area, rel=1e-6)
                for one, two in ((vertices, other), (other, vertices)):
                    assert cKDTree(one).query(two)[0].max() < 1e-6
        for row, body in enumerate(random.bodies):  # and MuJoCo reads the same
            T = np.eye(4)
            T[:3, :3], T[:3, 3] = data.body(f"l{row}").xmat.reshape(3, 3), data.body(f"l{row}").xpos
            np.testing.assert_allclose(T, poses[row] @ random.own[row], atol=1e-9)
            assert body.parent < row


@pytest.mark.parametrize("seed", range(6))
def test_a_robot_written_three_ways_is_one(tmp_path: Path, seed: int) -> None:
    check(seed, tmp_path)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(6, 200))
def test_200_robots_written_three_ways_are_the_same(tmp_path: Path, seed: int) -> None:
    check(seed, tmp_path)

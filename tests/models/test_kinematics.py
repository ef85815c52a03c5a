"""Poses and Jacobians of every robot against pinocchio, which reads the same files by itself."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import proxcgal as px

POSTURES = 1000


def _mjcf(robot: px.Robot) -> pin.Model:
    return pin.buildModelFromMJCF(robot.source)


def _urdf(robot: px.Robot) -> pin.Model:
    return pin.buildModelFromUrdf(robot.source)


def _xacro(robot: px.Robot) -> pin.Model:
    from xacrodoc import XacroDoc, packages

    packages.update_package_cache({"kuka_kr150_support": str(Path(robot.source).parents[1])})
    doc = XacroDoc.from_file(robot.source, resolve_packages=False)
    return pin.buildModelFromXML(doc.to_urdf_string())


CASES = [
    pytest.param(("ur10e", _mjcf, "flange"), id="ur10e"),
    pytest.param(("panda", _mjcf, "flange"), id="panda"),
    pytest.param(("kr150", _xacro, "tool0"), id="kr150"),
    pytest.param(
        ("ur_description/urdf/ur10e.urdf", _urdf, "tool0"),
        id="user ur10e",
        marks=pytest.mark.shared,
    ),
    pytest.param(
        ("kuka_kr150_support/urdf/kr150r3100_2.urdf", _urdf, "tool0"),
        id="user kr150",
        marks=pytest.mark.shared,
    ),
]


class Oracle:
    """pinocchio's own poses and Jacobians, in the frame that is the world here."""

    def __init__(self, model: pin.Model, base: str) -> None:
        self.model, self.data = model, model.createData()
        pin.framesForwardKinematics(model, self.data, pin.neutral(model))
        self.T_WU = np.linalg.inv(self.data.oMf[self.frame(base)].homogeneous)

    def frame(self, name: str) -> int:
        return int(self.model.getFrameId(name, pin.FrameType.BODY))

    def update(self, q: np.ndarray) -> None:
        pin.computeJointJacobians(self.model, self.data, q)
        pin.updateFramePlacements(self.model, self.data)

    def pose(self, name: str) -> np.ndarray:
        return self.T_WU @ self.data.oMf[self.frame(name)].homogeneous

    def jacobian(self, name: str, point_W: np.ndarray) -> np.ndarray:
        row = self.frame(name)
        J = pin.getFrameJacobian(self.model, self.data, row, pin.LOCAL_WORLD_ALIGNED)
        R = self.T_WU[:3, :3]
        linear, angular = R @ J[:3], R @ J[3:]
        arm = point_W - self.pose(name)[:3, 3]
        return np.vstack([linear + np.cross(angular.T, arm).T, angular])


Case = tuple[px.Robot, Oracle, str, np.ndarray]


@pytest.fixture(scope="module", params=CASES)
def case(request: pytest.FixtureRequest) -> Case:
    name, read, flange = request.param
    # Kinematics do not depend on the meshes.
    path = request.getfixturevalue("shared_robots") / name if "/" in name else name
    robot = px.load_robot(path, vertices_per_link=None)
    base = "link0" if name == "panda" else "base_link"
    rng = np.random.default_rng(7)
    q = rng.uniform(robot.q_min, robot.q_max, (POSTURES, robot.n_q))
    return robot, Oracle(read(robot), base), flange, q


def test_poses_agree_with_pinocchio(case: Case) -> None:
    robot, oracle, flange, postures = case
    worst = 0.0
    for q in postures:
        oracle.update(q)
        expected = [oracle.pose(name) for name in robot.link_names]
        worst = max(worst, np.abs(robot.link_poses(q) - expected).max())
        worst = max(worst, np.abs(robot.tool_pose(q) - oracle.pose(flange)).max())
    assert worst < 1e-9


def test_jacobians_agree_with_pinocchio(case: Case) -> None:
    robot, oracle, _, postures = case
    points = np.random.default_rng(8).uniform(-1, 1, (POSTURES, 3))
    worst = 0.0
    for k, (q, point_W) in enumerate(zip(postures, points, strict=True)):
        oracle.update(q)
        name = robot.link_names[k % len(robot.link_names)]
        expected = oracle.jacobian(name, point_W)
        worst = max(worst, np.abs(robot.jacobian(q, name, point_W) - expected).max())
    assert worst < 1e-9


def test_jacobian_is_the_derivative_of_the_point(
    case: Case,
) -> None:
    robot, _, _, postures = case
    step = 1e-6
    for q in postures[:10]:
        for row, name in enumerate(robot.link_names):
            poses = robot.link_poses(q)
            point_W = poses[row] @ [0.1, -0.2, 0.3, 1]
            numeric = np.empty((3, robot.n_q))
            for joint in range(robot.n_q):
                d = np.zeros(robot.n_q)
                d[joint] = step
                ahead, behind = (
                    robot.link_poses(q + s * d)[row] @ [0.1, -0.2, 0.3, 1] for s in (1, -1)
                )
                numeric[:, joint] = (ahead - behind)[:3] / (2 * step)
            J = robot.jacobian(q, name, point_W[:3])[:3]
            np.testing.assert_allclose(J, numeric, atol=2e-8)


@pytest.mark.shared
def test_built_in_ur10e_stands_where_the_urdf_does(shared_robots: Path) -> None:
    own = px.load_robot("ur10e", vertices_per_link=None)
    user = px.load_robot(shared_robots / "ur_description/urdf/ur10e.urdf", vertices_per_link=None)
    assert own.joint_names == user.joint_names
    assert own.tool == user.tool == "tool0"
    np.testing.assert_allclose(own.q_min, user.q_min, atol=1e-9)
    np.testing.assert_allclose(own.q_max, user.q_max, atol=1e-9)
    np.testing.assert_allclose(own.qd_max, user.qd_max, atol=1e-9)
    rng = np.random.default_rng(9)
    for q in rng.uniform(own.q_min, own.q_max, (100, 6)):
        np.testing.assert_allclose(own.tool_pose(q), user.tool_pose(q), atol=1e-6)
    q = rng.uniform(own.q_min, own.q_max)
    poses = own.link_poses(q), user.link_poses(q)
    for row, (mine, theirs) in enumerate(zip(own.link_names, user.link_names, strict=True)):
        (v, _), (w, _) = own.full_mesh(mine), user.full_mesh(theirs)
        back = np.linalg.inv(poses[1][row]) @ poses[0][row]
        there = own.tree(mine).closest(
            (w - back[:3, 3]) @ back[:3, :3]
        )[0]  # fmt: skip
        here = user.tree(theirs).closest(v @ back[:3, :3].T + back[:3, 3])[0]
        assert max(there.max(), here.max()) < 1e-3


def test_ur10e_reaches_where_its_geometry_says() -> None:
    # Stretched: a2 + a3 and d6 lie along x, d4 + ... across; Universal Robots' DH parameters.
    pose = px.load_robot("ur10e", vertices_per_link=None).tool_pose(np.zeros(6))
    expected = [0.6127 + 0.57155, 0.17415 + 0.11655, 0.1807 - 0.11985]
    np.testing.assert_allclose(pose[:3, 3], expected, atol=1e-4)

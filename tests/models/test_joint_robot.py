"""The 12-joint robot: both arms as one chain, by name and out of a user's own files."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import proxcgal as px
from proxcgal.models.limits import LIMITS
from proxcgal.models.surfaces import Surfaces
from proxcgal.scenario.joint_scenario import CONFIGURATIONS
from proxcgal.scenario.setup import posture_problems

FREE = np.array(CONFIGURATIONS["free"])


@pytest.fixture(scope="module")
def joint() -> px.Robot:
    return px.load_robot("kr150_ur10e")


def test_both_arms_are_one_chain_with_their_own_limits(joint: px.Robot) -> None:
    assert joint.n_q == 12
    assert [name.partition("_")[0] for name in joint.joint_names] == ["kuka"] * 6 + ["ur10e"] * 6
    assert joint.tool == "ur10e_tool0"
    for rows, name in ((slice(0, 6), "kr150"), (slice(6, 12), "ur10e")):
        known = LIMITS[name]
        for own, limit in (
            (joint.q_min, known.q_min),
            (joint.q_max, known.q_max),
            (joint.qd_max, known.qd_max),
            (joint.qdd_max, known.qdd_max),
        ):
            np.testing.assert_allclose(own[rows], limit)


def test_the_ur10e_stands_on_the_flange_coaxially(joint: px.Robot) -> None:
    """Pitch +90 degrees from link_6: its z is the KUKA's x, out of the flange."""
    kuka, ur10e = px.load_robot("kr150"), px.load_robot("ur10e")
    rng = np.random.default_rng(0)
    pitch = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    for q in rng.uniform(joint.q_min, joint.q_max, (20, 12)):
        T_WF = np.eye(4)
        T_WF[:3, :3] = kuka.link_poses(q[:6])[-1][:3, :3] @ pitch
        T_WF[:3, 3] = kuka.tool_pose(q[:6])[:3, 3]
        np.testing.assert_allclose(joint.tool_pose(q), T_WF @ ur10e.tool_pose(q[6:]), atol=1e-9)


def test_it_is_what_attach_makes_of_the_two(joint: px.Robot) -> None:
    made = px.attach(
        px.load_robot("kr150"), "tool0", px.load_robot("ur10e"), np.eye(4), ("kuka_", "ur10e_")
    )
    assert made.digest == joint.digest
    assert made.name == joint.name


def test_each_arms_meshes_are_taken_over(joint: px.Robot) -> None:
    for prefix, name in (("kuka_", "kr150"), ("ur10e_", "ur10e")):
        alone = px.load_robot(name)
        assert [prefix + link for link in alone.link_names] == [
            link for link in joint.link_names if link.startswith(prefix)
        ]
        for link in alone.link_names:
            np.testing.assert_array_equal(joint.full_mesh(prefix + link)[0],
                                          alone.full_mesh(link)[0])  # fmt: skip


def test_pairs_that_are_built_near_are_excluded_across_the_mounting_too(joint: px.Robot) -> None:
    names = joint.link_names
    pairs = {(names[a], names[b]) for a, b in Surfaces.of(joint).self_pairs}
    assert ("kuka_link_6", "ur10e_base_link") not in pairs
    assert ("kuka_link_6", "ur10e_shoulder_link") not in pairs  # one joint between them
    assert ("kuka_link_3", "ur10e_forearm_link") in pairs
    assert ("ur10e_shoulder_link", "ur10e_wrist_1_link") in pairs


def test_mob_mob_is_refused_with_joint_value_and_limit(joint: px.Robot) -> None:
    assert posture_problems(joint, CONFIGURATIONS["mob_mob"], "configurations.mob_mob") == [
        "configurations.mob_mob.1 = 0.785398: kuka_joint_a2 of kr150_ur10e goes from -2.54818 to 0"
    ]
    for name in ("free", "jl"):
        assert posture_problems(joint, CONFIGURATIONS[name], name) == []


@pytest.mark.shared
def test_the_same_with_the_r3100_2_of_a_users_own_files(shared_robots: Path) -> None:
    file = next((shared_robots / "kuka_kr150_support").rglob("*r3100*.urdf"))
    own = px.load_robot(file, [shared_robots], vertices_per_link=None)
    ur10e = px.load_robot("ur10e")
    both = px.attach(own, own.tool, ur10e, np.eye(4), ("kuka_", "ur10e_"))
    assert both.n_q == 12
    np.testing.assert_allclose(both.q_min[:6], own.q_min)
    # The oracle for the lower arm: pin on the file alone.
    model = pin.buildModelFromUrdf(str(file))
    data = model.createData()
    rng = np.random.default_rng(0)
    for q in rng.uniform(both.q_min, both.q_max, (20, 12)):
        pin.framesForwardKinematics(model, data, q[:6])
        T_WF = data.oMf[model.getFrameId(own.tool)].homogeneous
        np.testing.assert_allclose(both.tool_pose(q), T_WF @ ur10e.tool_pose(q[6:]), atol=1e-6)

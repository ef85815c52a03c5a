"""MJCF files of a user's own: read as MuJoCo reads them, or refused by name."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

import proxcgal as px

OWN = """<mujoco model="own">
  <compiler angle="{angle}" meshdir="meshes"/>
  <default><default class="link"><joint axis="0 1 0"/></default></default>
  <asset><mesh name="part" file="part.stl" scale="0.5 1 2"/></asset>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 0.1"/>
    <geom name="pedestal" type="box" size="0.1 0.2 0.3" pos="0 0 -0.3"/>
    <body name="shoulder" pos="0 0 0.1" euler="0 0 {turn}" childclass="link">
      <joint name="j1" axis="0 0 1" pos="0.1 0 0" range="-{turn} {turn}" limited="true"/>
      <geom type="capsule" fromto="0 0 0 0 0 0.5" size="0.05"/>
      <body name="elbow" pos="0 0 0.5">
        <joint name="j2"/>
        <geom type="mesh" mesh="part" pos="0.1 0 0.2" contype="0" conaffinity="0" group="2"/>
        <geom type="cylinder" size="0.3 0.3"/>
        <body name="slider" pos="0 0.1 0.5">
          <joint name="j3" type="slide" axis="1 0 1" range="0 0.2" limited="true"/>
          <geom type="ellipsoid" size="0.1 0.2 0.3"/>
          <site name="tcp" pos="0 0 0.1"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>"""


@pytest.fixture(params=["degree", "radian"])
def own(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A robot of three joints with a mesh and every simple shape, in either angle unit."""
    import trimesh

    (tmp_path / "meshes").mkdir()
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "meshes" / "part.stl")
    path = tmp_path / "own.xml"
    path.write_text(OWN.format(angle=request.param, turn=45 if request.param == "degree" else 0.7))
    return path


def test_poses_and_limits_are_those_of_mujoco(own: Path) -> None:
    robot = px.load_robot(own, speed_limits=1)
    model = mujoco.MjModel.from_xml_path(str(own))
    data = mujoco.MjData(model)
    limited = model.jnt_limited.astype(bool)
    np.testing.assert_allclose(robot.q_min, np.where(limited, model.jnt_range[:, 0], -np.inf))
    np.testing.assert_allclose(robot.q_max, np.where(limited, model.jnt_range[:, 1], np.inf))
    assert robot.tool == "tcp"
    rng = np.random.default_rng(3)
    for q in rng.uniform(-0.5, 0.5, (20, 3)):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        poses = dict(zip(robot.link_names, robot.link_poses(q), strict=True))
        for name in ("shoulder", "elbow", "slider"):
            expected = np.eye(4)
            expected[:3, :3] = data.body(name).xmat.reshape(3, 3)
            expected[:3, 3] = data.body(name).xpos
            np.testing.assert_allclose(poses[name], expected, atol=1e-9)
        np.testing.assert_allclose(robot.tool_pose(q)[:3, 3], data.site("tcp").xpos, atol=1e-9)


def test_links_look_as_their_visual_geoms_else_as_all_they_have(own: Path) -> None:
    robot = px.load_robot(own, speed_limits=1, vertices_per_link=None)
    assert robot.link_names == ["world", "shoulder", "elbow", "slider"]

    def box_of(link: str) -> np.ndarray:
        v, _ = robot.full_mesh(link)
        return np.array([v.min(axis=0), v.max(axis=0)])

    np.testing.assert_allclose(box_of("world"), [[-0.1, -0.2, -0.6], [0.1, 0.2, 0]], atol=1e-9)
    np.testing.assert_allclose(box_of("shoulder"), [[-0.05, -0.05, -0.05], [0.05, 0.05, 0.55]],
                               atol=1e-3)  # fmt: skip
    # The mesh, scaled and shifted, without the cylinder that is there for contacts.
    np.testing.assert_allclose(box_of("elbow"), [[0.075, -0.05, 0.1], [0.125, 0.05, 0.3]],
                               atol=1e-6)  # fmt: skip
    np.testing.assert_allclose(box_of("slider"), [[-0.1, -0.2, -0.3], [0.1, 0.2, 0.3]], atol=1e-3)


BODY = '<body name="b"><joint name="j"/><geom size="0.1"/>{}</body>'
INNER = '<body name="c"><joint name="k"/><geom size="0.1"/></body>'
TENDON = "<tendon>{}</tendon>"
FIXED = '<fixed name="t"{}><joint joint="j" coef="1"/>{}</fixed>'
REFUSED = {
    "second body at the top": (BODY.format("") + '<body name="c"><geom size="0.1"/></body>', "",
                               "'b', 'c' stand side by side"),
    "included file that is not there": (
        "", '<include file="x.xml"/>', "no file 'x.xml' of <include>"),
    "included file elsewhere": (
        "", '<include file="../../etc/hosts"/>', "<include> names .* outside of"),
    "attached file elsewhere": (
        "", '<asset><model name="m" file="/etc/hosts"/></asset>', "<model> names .* outside of"),
    "free joint": ('<body name="b"><freejoint name="fly"/><geom size="0.1"/></body>', "",
                   "joint 'fly' of body 'b' is free"),
    "ball joint": ('<body name="b"><joint name="j" type="ball"/><geom size="0.1"/></body>', "",
                   "joint 'j' of body 'b' is ball"),
    "zero axis": ('<body name="b"><joint name="j" axis="0 0 0"/><geom size="0.1"/></body>', "",
                  "axis too small .* 'j'"),
    "nan": ('<body name="b" pos="nan 0 0"><joint name="j"/><geom size="0.1"/></body>', "",
            "no finite number"),
    "two bodies of a name": (BODY.format('<body name="b"/>'), "", "repeated name 'b' in body"),
    "bound joint": (BODY.format(INNER), '<equality><joint joint1="j" joint2="k"/></equality>',
                    "joint 'j' is bound to 'k'"),
    "joint bound to a constant": (BODY.format(INNER), '<equality><joint joint1="j"/></equality>',
                                  "joint 'j' is bound to a constant"),
    "closed loop": (BODY.format(INNER), '<equality><connect body1="c" body2="b" anchor="0 0 0"/>'
                    "</equality>", "'c' is bound to 'b' .connect equality"),
    "welded to the world": (BODY.format(INNER), '<equality><weld body1="c"/></equality>',
                            "'c' is bound to 'the world' .weld"),
    "equality that is off": (
        BODY.format(INNER), '<equality><joint joint1="j" joint2="k" active="false"/></equality>',
        "joint 'j' is bound to 'k'"),
    "equality of tendons": (
        BODY.format(INNER), TENDON.format(FIXED.format("", ""))
        + '<equality><tendon name="e" tendon1="t"/></equality>', "'t' is bound .* 'e'"),
    "tendon over two joints": (
        BODY.format(INNER), TENDON.format(FIXED.format("", '<joint joint="k" coef="-1"/>')),
        "tendon 't' over joints 'j', 'k'"),
    "tendon with limits": (BODY.format(INNER), TENDON.format(
        FIXED.format(' limited="true" range="-1 1"', "")), "tendon 't' over joints 'j'"),
    "sdf": ('<body name="b"><joint name="j"/><geom type="sdf" name="s" mesh="m"/></body>',
            '<asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>', "'s' of body 'b'"),
    "plugin": (BODY.format('<plugin plugin="mujoco.elasticity.cable"/>'), "",
               "<plugin mujoco.elasticity.cable> is not read"),
    "endless copies": (f'<replicate count="100000000">{BODY.format("")}</replicate>', "",
                       "more than|status"),
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSED)
def test_refused_with_the_file_and_the_names(tmp_path: Path, what: str) -> None:
    inside, beside, said = REFUSED[what]
    path = tmp_path / "bad.xml"
    path.write_text(f"<mujoco>{beside}<worldbody>{inside}</worldbody></mujoco>")
    with pytest.raises(px.ModelError, match=said) as caught:
        px.load_robot(path, speed_limits=1)
    assert "bad.xml" in str(caught.value)


@pytest.mark.parametrize(
    ("file", "said"), [("gone.stl", "no mesh file"), ("../../etc/hosts", "outside of")]
)
def test_mesh_files_are_there_and_within_the_folder(tmp_path: Path, file: str, said: str) -> None:
    path = tmp_path / "bad.xml"
    path.write_text(
        f'<mujoco><asset><mesh name="m" file="{file}"/></asset><worldbody><body name="b">'
        '<joint name="j"/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>'
    )
    with pytest.raises(px.ModelError, match=rf"{said}(.|\n)*") as caught:
        px.load_robot(path, speed_limits=1)
    assert "mesh 'm' of link 'b'" in str(caught.value)


def test_the_built_in_file_loads_as_a_users_own() -> None:
    builtin = px.load_robot("ur10e", vertices_per_link=None)
    user = px.load_robot(builtin.source, speed_limits=builtin.qd_max, vertices_per_link=None)
    q = [0.1, -1.2, 0.8, 0.3, -0.4, 1.0]
    np.testing.assert_allclose(user.link_poses(q), builtin.link_poses(q), atol=1e-12)
    np.testing.assert_allclose(user.tool_pose(q), builtin.tool_pose(q), atol=1e-12)

"""Kinds of MJCF that people write: as MuJoCo's own compiled model has them."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from random_robots import F, V, write_mesh
from scipy.spatial import cKDTree

import proxcgal as px

BOX = '<geom type="box" size=".1 .12 .14"/>'
JOINT = '<joint name="j" axis="0 0 1" range="-60 60"/>'
MESH = '<asset><mesh name="m" file="part.stl"/></asset>'
INNER = (
    '<body name="l2" pos="0 0 .3"><joint name="j2" axis="0 1 0" range="-60 60"/>'
    '<geom type="box" size=".02 .02 .1"/></body>'
)


def arm(
    joint: str = JOINT, geom: str = BOX, *, before: str = "", inner: str = "", tail: str = "",
    root: str = "", body: str = "",
) -> str:  # fmt: skip
    return (
        f'<mujoco model="m">{before}<worldbody><body name="base" {root}>'
        f'<geom type="box" size=".05 .05 .05"/><body name="l1" pos="0.1 0.2 0.3" {body}>{joint}'
        f"{geom}{inner}</body></body></worldbody>{tail}</mujoco>"
    )


def classed(kind: str, inside: str) -> str:
    return f'<default><default class="{kind}">{inside}</default></default>'


def mesh_asset(attributes: str) -> str:
    return f'<asset><mesh name="m" file="part.stl" {attributes}/></asset>'


SHOWN = '<geom type="mesh" mesh="m"/>'
KINDS = {
    "plain": arm(),
    "placed root": arm(root='pos="0 0 0.9" euler="10 20 30"'),
    "unlimited": arm('<joint name="j"/>'),
    "limits off": arm('<joint name="j" range="-60 60" limited="false"/>'),
    "limits off by class": arm('<joint name="j" range="-60 60" class="c"/>',
                               before=classed("c", '<joint limited="false"/>')),
    "no automatic limits": arm('<joint name="j" range="-60 60"/>',
                               before='<compiler autolimits="false"/>').replace(
                                   'range="-60 60"', 'range="-60 60" limited="true"'),
    "radians": arm('<joint name="j" range="-1 1"/>', before='<compiler angle="radian"/>'),
    "two compilers": arm('<joint name="j" range="-1 1"/>',
                         before='<compiler/><compiler angle="radian"/>'),
    "compiler at the end": arm('<joint name="j" range="-1 1"/>',
                               tail='<compiler angle="radian"/>'),
    "ref": arm('<joint name="j" range="-60 60" ref="30"/>'),
    "ref of a slide": arm('<joint name="j" type="slide" axis="1 1 0" range="-1 1" ref=".3"/>'),
    "ref by class": arm('<joint name="j" class="c" range="-60 60"/>',
                        before=classed("c", '<joint ref="30"/>')),
    "place and axis by class": arm('<joint name="j" class="c"/>', before=classed(
        "c", '<joint axis="1 1 0" pos=".1 0 0" range="-10 10"/>')),
    "class of the body": arm('<joint name="j"/>', body='childclass="c"', before=classed(
        "c", '<joint axis="1 0 0" pos="0 .1 0" range="-10 10"/>')),
    "class in a class": arm('<joint name="j" class="d"/>', before=classed(
        "c", '<joint axis="1 0 0" range="-10 10"/><default class="d"><joint pos="0 .1 0"/>'
        "</default>")),
    "long axis": arm('<joint name="j" axis="0 3 4" range="-10 10"/>'),
    "two joints in a body": arm(
        '<joint name="j" axis="1 0 0" pos=".1 0 0"/><joint name="k" axis="0 1 0" pos="0 .2 0"/>'),
    "slide then hinge in a body": arm(
        '<joint name="j" type="slide" axis="1 1 0" ref=".1"/>'
        '<joint name="k" axis="0 1 1" pos="0 .2 0" ref="20"/>'),
    "euler zyx": arm(before='<compiler eulerseq="zyx"/>', body='euler="10 20 30"'),
    "euler XYZ": arm(before='<compiler eulerseq="XYZ"/>', body='euler="10 20 30"'),
    "euler in radians": arm('<joint name="j"/>', before='<compiler angle="radian"/>',
                            body='euler=".1 .2 .3"'),
    "axis and angle": arm(body='axisangle="1 1 0 40"'),
    "xyaxes": arm(body='xyaxes="0 1 0 -1 1 0"'),
    "zaxis": arm(body='zaxis="1 1 1"'),
    "quaternion of another length": arm(body='quat="2 0 1 0"'),
    "capsule from to": arm(geom='<geom type="capsule" fromto="0 0 0 .1 .2 .3" size=".05"/>'),
    "cylinder": arm(geom='<geom type="cylinder" size=".05 .1" euler="30 0 0"/>'),
    "sphere": arm(geom='<geom size=".07" pos=".1 0 0"/>'),
    "ellipsoid": arm(geom='<geom type="ellipsoid" size=".1 .2 .3" euler="0 40 0"/>'),
    "geom by class": arm(geom='<geom class="g" mesh="m"/>', before=classed(
        "g", '<geom type="mesh" pos=".1 0 0" quat="0 0 1 0"/>') + MESH),
    "mesh": arm(geom='<geom type="mesh" mesh="m" pos=".1 .2 .3" euler="10 20 30"/>', before=MESH),
    "mesh scale": arm(geom=SHOWN, before=mesh_asset('scale=".5 2 1"')),
    "mirrored mesh": arm(geom=SHOWN, before=mesh_asset('scale="-1 1 1"')),
    "mesh scale by default": arm(geom=SHOWN, before='<default><mesh scale="2 2 2"/></default>'
                                 + MESH),
    "mesh with a reference": arm(geom=SHOWN, before=mesh_asset(
        'refpos=".1 .2 .3" refquat="1 1 0 0" scale="1 -2 1"')),
    "mesh named by its file": arm(geom='<geom type="mesh" mesh="part"/>',
                                  before='<asset><mesh file="part.stl"/></asset>'),
    "mesh in a folder": arm(geom=SHOWN, before='<compiler meshdir="meshes"/>' + MESH),
    "mesh by its last name": arm(geom=SHOWN, before='<compiler strippath="true"/>'
                                 '<asset><mesh name="m" file="else/where/part.stl"/></asset>'),
    "mesh inline": arm(geom=SHOWN, before='<asset><mesh name="m" '
                       'vertex="0 0 0 .1 0 0 0 .2 0 0 0 .3" '
                       'face="0 2 1 0 1 3 0 3 2 1 2 3"/></asset>'),
    "mesh inline, hull": arm(geom=SHOWN, before='<asset><mesh name="m" '
                             'vertex="0 0 0 .1 0 0 0 .2 0 0 0 .3"/></asset>'),
    "box fitted to a mesh": arm(geom='<geom type="box" mesh="m"/>', before=MESH),
    "capsule fitted to a mesh": arm(geom='<geom type="capsule" mesh="m"/>',
                                    before='<compiler fitaabb="true"/>' + MESH),
    "two meshes and a shape": arm(geom=SHOWN + '<geom type="mesh" mesh="m" pos="1 0 0"/>' + BOX,
                                  before=MESH),
    "two world bodies": arm(tail='<worldbody><geom type="plane" size="1 1 1"/></worldbody>'),
    "shapes of the world": arm(tail='<worldbody><geom type="box" size=".1 .1 .1" pos="0 0 -1"/>'
                               "</worldbody>"),
    "terrain": arm(before='<asset><hfield name="h" nrow="2" ncol="2" size="1 1 1 1"/></asset>',
                   tail='<worldbody><geom type="hfield" hfield="h"/></worldbody>'),
    "material with a texture": arm(
        geom='<geom type="box" size=".1 .1 .1" material="x"/>',
        before='<asset><texture name="t" type="2d" file="no_such.png"/>'
        '<material name="x" texture="t"/></asset>'),
    "frame": arm().replace('<body name="l1"', '<frame pos="1 0 0" euler="0 0 45"><body name="l1"')
    .replace("</body></body>", "</body></frame></body>"),
    "frames in frames": arm().replace(
        '<body name="l1"', '<frame pos="1 0 0"><frame euler="20 0 45"><body name="l1"')
    .replace("</body></body>", "</body></frame></frame></body>"),
    "replicated geoms": arm(geom='<replicate count="3" offset="0 0 .2" euler="0 0 10">'
                            + BOX + "</replicate>"),
    "replicated bodies": arm(inner=f'<replicate count="2" offset=".5 0 0" sep="-">{INNER}'
                             "</replicate>"),
    "included": arm(before='<include file="parts/asset.xml"/>', geom=SHOWN),
    "included in an included": arm(before='<include file="parts/outer.xml"/>', geom=SHOWN),
    "attached": arm(inner='<frame pos="0 0 .2"><attach model="hand" body="palm" prefix="h_"/>'
                    "</frame>", before='<asset><model name="hand" file="parts/hand.xml"/></asset>'),
    "static bodies kept": arm(before='<compiler fusestatic="true"/>', inner='<body name="fixed" '
                              'pos="0 0 1"><geom type="box" size=".1 .1 .1"/></body>'),
    "equal tendon of one joint": arm(tail='<tendon><fixed name="t"><joint joint="j" coef="1"/>'
                                     "</fixed></tendon>"),
    "actuator and sensor": arm(tail='<actuator><position joint="j" kp="1"/></actuator>'
                               '<sensor><jointpos joint="j"/></sensor>'),
    "keyframe": arm(tail='<keyframe><key qpos="0.2"/></keyframe>'),
    "camera and light": arm(tail="<worldbody><camera/><light/><site name='mark'/></worldbody>"),
    "empty body beside": arm(tail='<worldbody><body name="target" mocap="true"><geom size=".1"/>'
                             "</body></worldbody>"),
    "arm on a mocap body": arm(root='mocap="true" pos="0 0 .5"'),
    "nameless": arm('<joint axis="0 1 0"/>'),
    "look and contact": arm(geom='<geom type="box" size=".1 .1 .1" contype="0" conaffinity="0"/>'
                            '<geom type="sphere" size=".05" group="3"/>'),
}  # fmt: skip
# What is drawn of a body is its look: without these, which are for contacts or are no part of it.
NOT_SHOWN = {"look and contact": [2], "empty body beside": []}


@pytest.fixture
def files(tmp_path: Path) -> Path:
    for folder in ("meshes", "parts"):
        (tmp_path / folder).mkdir()
    for path in (tmp_path, tmp_path / "meshes", tmp_path / "parts"):
        write_mesh(path / "part.stl")
    (tmp_path / "parts" / "asset.xml").write_text(f"<mujocoinclude>{MESH}</mujocoinclude>")
    (tmp_path / "parts" / "outer.xml").write_text(
        '<mujocoinclude><include file="asset.xml"/></mujocoinclude>'
    )
    (tmp_path / "parts" / "hand.xml").write_text(
        '<mujoco model="hand"><compiler angle="radian"/>' + mesh_asset('scale="1 1 .5"')
        + '<worldbody><body name="palm" pos="0 0 1"><joint name="p" range="-1 1"/>'
        f"{SHOWN}</body></worldbody></mujoco>"
    )  # fmt: skip
    return tmp_path


def points(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> np.ndarray:
    """Extreme points of a geom in the world: a mesh's vertices, or along 6 directions."""
    R, p = data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom]
    size, kind = model.geom_size[geom], model.geom_type[geom]
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first = model.mesh_vertadr[mesh]
        return model.mesh_vert[first : first + model.mesh_vertnum[mesh]] @ R.T + p
    out = []
    for a in np.concatenate([np.eye(3), -np.eye(3)]) @ R:  # world directions in the geom's frame
        if kind == mujoco.mjtGeom.mjGEOM_BOX:
            out.append(np.sign(a) * size)
        elif kind == mujoco.mjtGeom.mjGEOM_SPHERE:
            out.append(a * size[0])
        elif kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            out.append(a * size**2 / np.linalg.norm(a * size))
        elif kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
            out.append(a * size[0] + [0, 0, np.sign(a[2]) * size[1]])
        else:
            flat = a[:2] / max(np.linalg.norm(a[:2]), 1e-300)
            out.append(np.array([*(flat * size[0]), np.sign(a[2]) * size[1]]))
    return np.array(out) @ R.T + p


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.filterwarnings("ignore::proxcgal.ModelWarning")
def test_it_is_as_mujoco_compiles_it(files: Path, kind: str) -> None:
    path = files / "robot.xml"
    path.write_text(KINDS[kind])
    # Pictures are passed over; MuJoCo opens them.
    drawn = KINDS[kind].replace('file="no_such.png"', 'builtin="flat" width="8" height="8"')
    drawn = drawn.replace('fusestatic="true"', "")  # every body stays one here
    (files / "reference.xml").write_text(drawn)
    model = mujoco.MjModel.from_xml_path(str(files / "reference.xml"))
    data = mujoco.MjData(model)
    robot = px.load_robot(path, vertices_per_link=None, speed_limits=1.0, tool="l1")
    names = [model.joint(i).name or f"joint{i}" for i in range(model.njnt)]
    assert robot.joint_names == names
    limited = model.jnt_limited.astype(bool)
    np.testing.assert_allclose(robot.q_min, np.where(limited, model.jnt_range[:, 0], -np.inf))
    np.testing.assert_allclose(robot.q_max, np.where(limited, model.jnt_range[:, 1], np.inf))
    round_shape = any(model.geom_type[g] in (2, 3, 4, 5) for g in range(model.ngeom))
    for q in np.random.default_rng(1).uniform(-0.3, 0.3, (3, robot.n_q)):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        for link, T in zip(robot.link_names, np.asarray(robot.link_poses(q)), strict=True):
            body = model.body(link)
            if link in {model.body(i).name for i in range(1, model.nbody)}:
                np.testing.assert_allclose(T[:3, :3], data.xmat[body.id].reshape(3, 3), atol=1e-9)
                np.testing.assert_allclose(T[:3, 3], data.xpos[body.id], atol=1e-9)
            geoms = [
                g for g in range(model.ngeom)
                if model.geom_bodyid[g] == body.id and model.geom_type[g] > 1
                and g not in NOT_SHOWN.get(kind, [])
            ]  # fmt: skip
            right = np.concatenate([points(model, data, g) for g in geoms])
            mine = robot.full_mesh(link)[0] @ T[:3, :3].T + T[:3, 3]
            within = 2e-3 if round_shape else 1e-6  # facets of round shapes
            for a in (right, mine):
                assert len(a)
            np.testing.assert_allclose(mine.min(axis=0), right.min(axis=0), atol=within)
            np.testing.assert_allclose(mine.max(axis=0), right.max(axis=0), atol=within)
            if not round_shape and "hull" not in kind and "fitted" not in kind:
                assert cKDTree(right).query(mine)[0].max() < 0.5
                meshes = [g for g in geoms if model.geom_type[g] == 7]
                if len(meshes) == len(geoms) and geoms:
                    assert cKDTree(right).query(mine)[0].max() < 1e-6
                    assert cKDTree(mine).query(right)[0].max() < 1e-6


def test_every_body_with_a_shape_is_a_link(files: Path) -> None:
    path = files / "robot.xml"
    path.write_text(KINDS["attached"])
    robot = px.load_robot(path, vertices_per_link=None, speed_limits=1.0)
    assert robot.link_names == ["base", "l1", "h_palm"]
    assert robot.tool == "h_palm"
    v, _ = robot.full_mesh("h_palm")
    np.testing.assert_allclose(np.ptp(v, axis=0), np.ptp(V * [1, 1, 0.5], axis=0), atol=1e-7)
    assert len(robot.full_mesh("h_palm")[1]) == len(F)


def test_a_changed_included_or_attached_file_is_noticed(files: Path) -> None:
    path = files / "robot.xml"
    path.write_text(KINDS["attached"])
    px.load_robot(path, vertices_per_link=None, speed_limits=1.0)
    hand = files / "parts" / "hand.xml"
    hand.write_text(hand.read_text().replace("-1 1", "-0.5 0.5"))
    assert px.load_robot(path, vertices_per_link=None, speed_limits=1.0).q_max[-1] == 0.5


def test_a_mesh_that_may_be_two_files_is_refused(files: Path) -> None:
    (files / "part.stl").rename(files / "parts" / "other.stl")
    path = files / "robot.xml"
    path.write_text(KINDS["attached"].replace("<asset>", '<asset><mesh name="o" file="hand.stl"/>'))
    for folder in (files, files / "parts"):
        write_mesh(folder / "hand.stl")
    px.load_robot(path, speed_limits=1.0, vertices_per_link=None)  # the same in both
    (files / "hand.stl").write_bytes((files / "hand.stl").read_bytes().replace(b"x", b"y", 1))
    with pytest.raises(px.ModelError, match=r"mesh 'o' may be .*hand\.stl or .*hand\.stl"):
        px.load_robot(path, speed_limits=1.0)

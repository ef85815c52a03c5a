"""URDF files that must be refused, by name, before any harm."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import proxcgal as px

BOX = '<visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual>'
LIMIT = '<limit lower="-1" upper="1" velocity="1" effort="1"/>'


def link(name: str, inside: str = BOX) -> str:
    return f'<link name="{name}">{inside}</link>'


def joint(
    name: str, parent: str, child: str, kind: str = "revolute",
    inside: str = f'<axis xyz="0 0 1"/>{LIMIT}',
) -> str:  # fmt: skip
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{inside}</joint>'


def robot_of(*parts: str) -> str:
    return f'<?xml version="1.0"?><robot name="r">{"".join(parts)}</robot>'


def mesh_robot(name: str) -> str:
    inside = f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
    return robot_of(link("a"), link("b", inside), joint("j", "a", "b"))


ARM = (link("a"), link("b"), joint("j", "a", "b"))

REFUSED = {
    "cycle": (
        robot_of(link("a"), link("b"), link("c"), joint("ab", "a", "b"), joint("bc", "b", "c"),
                 joint("ca", "c", "a")),
        r"'a', 'c', 'b' form a cycle \(joints 'ca', 'bc', 'ab'\)",
    ),
    "cycle beside a tree": (
        robot_of(*ARM, link("c"), link("d"), joint("cd", "c", "d"), joint("dc", "d", "c")),
        "'c', 'd' form a cycle",
    ),
    "own parent": (robot_of(*ARM, link("c"), joint("cc", "c", "c")), "'c' form a cycle"),
    "two parents": (
        robot_of(link("a"), link("b"), link("c"), joint("ab", "a", "b"), joint("ac", "a", "c"),
                 joint("bc", "b", "c")),
        "link 'c' has two parents: 'a' by joint 'ac' and 'b' by joint 'bc'",
    ),
    "orphan": (robot_of(*ARM, link("lost")), "'a', 'lost' have no parent"),
    "unknown parent": (robot_of(link("b"), joint("j", "x", "b")), "'j' names link 'x'"),
    "unknown child": (robot_of(link("b"), joint("j", "b", "x")), "'j' names link 'x'"),
    "no child": (robot_of(link("b"), '<joint name="j" type="fixed"><parent link="b"/></joint>'),
                 "'j' has no <child"),
    "link twice": (robot_of(*ARM, link("b")), "more than one link is called 'b'"),
    "joint twice": (robot_of(*ARM, link("c"), joint("j", "b", "c")), "two joints are called 'j'"),
    "link without a name": (robot_of("<link/>"), "a <link> without a name"),
    "zero axis": (
        robot_of(link("a"), link("b"), joint("j", "a", "b", inside=f'<axis xyz="0 0 0"/>{LIMIT}')),
        "joint 'j' has axis 0 0 0",
    ),
    "nan axis": (
        robot_of(link("a"), link("b"),
                 joint("j", "a", "b", inside=f'<axis xyz="0 nan 1"/>{LIMIT}')),
        "axis is '0 nan 1'; 3 finite numbers",
    ),
    "short origin": (
        robot_of(link("a"), link("b"), joint("j", "a", "b", inside='<origin xyz="0 1"/>' + LIMIT)),
        "origin xyz is '0 1'",
    ),
    "no limit": (robot_of(link("a"), link("b"), joint("j", "a", "b", inside="")),
                 "revolute and has no <limit>"),
    "crossed limits": (
        robot_of(link("a"), link("b"), joint(
            "j", "a", "b", inside='<limit lower="1" upper="-1" velocity="1" effort="1"/>')),
        "lower limit 1.0 and upper limit -1.0",
    ),
    "floating": (robot_of(link("a"), link("b"), joint("j", "a", "b", "floating", "")),
                 "joint 'j' is floating"),
    "planar": (robot_of(link("a"), link("b"), joint("j", "a", "b", "planar", "")),
               "joint 'j' is planar"),
    "mimic": (
        robot_of(*ARM, link("c"), joint("k", "b", "c", inside=f'<mimic joint="j"/>{LIMIT}')),
        "joint 'k' follows joint 'j'",
    ),
    "odd shape": (
        robot_of(*ARM, link("c", "<visual><geometry><cone/></geometry></visual>"),
                 joint("k", "b", "c")),
        "link 'c' has shape <cone>",
    ),
    "no joint that moves": (robot_of(link("a"), link("b"), joint("j", "a", "b", "fixed", "")),
                            "no moving joint"),
    "nothing with a surface": (robot_of(link("a", ""), link("b", ""), joint("j", "a", "b")),
                               "no link has a mesh"),
    "no links": (robot_of(), "no links"),
    "not xml": ("hello", "not well-formed"),
    "cut off": (robot_of(*ARM)[:-20], "not well-formed"),
    "another kind of file": ("<sdf/>", "outermost tag is <sdf>"),
    "entity": (
        '<!DOCTYPE robot [<!ENTITY a "b">]>' + robot_of(*ARM), "document type declaration",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSED)
def test_refused_with_the_file_and_the_names(tmp_path: Path, what: str) -> None:
    text, said = REFUSED[what]
    path = tmp_path / "bad.urdf"
    path.write_text(text)
    with pytest.raises(px.ModelError, match=said) as caught:
        px.load_robot(path)
    assert "bad.urdf" in str(caught.value)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("gone.stl", r"no mesh file 'gone\.stl' of link 'b'"),
        ("package://nowhere/gone.stl", "no mesh file 'package://nowhere/gone.stl' of link 'b'"),
        ("../../etc/hosts", "outside of"),
        ("/etc/hosts", "outside of"),
        ("file:///etc/hosts", "outside of"),
        ("package://own/../../../../../../etc/hosts", "outside of"),
        ("package://../etc/hosts", "outside of|no mesh file"),
        ("https://example.org/x.stl", "only package://, file://"),
    ],
)
def test_mesh_paths_stay_within_their_folders(tmp_path: Path, name: str, said: str) -> None:
    folder = tmp_path / "own" / "urdf"
    folder.mkdir(parents=True)
    path = folder / "bad.urdf"
    path.write_text(mesh_robot(name))
    with pytest.raises(px.ModelError, match=said) as caught:
        px.load_robot(path)
    assert "link 'b'" in str(caught.value)
    assert "bad.urdf" in str(caught.value)


def test_packages_are_found_by_name_by_folder_and_as_the_folder_itself(tmp_path: Path) -> None:
    import trimesh

    meshes = tmp_path / "ws" / "thing" / "meshes"
    meshes.mkdir(parents=True)
    trimesh.creation.box((0.2, 0.2, 0.2)).export(meshes / "b.stl")
    (tmp_path / "elsewhere").mkdir()
    path = tmp_path / "elsewhere" / "r.urdf"
    path.write_text(mesh_robot("package://thing/meshes/b.stl"))
    for folder in (tmp_path / "ws", tmp_path / "ws" / "thing"):
        robot = px.load_robot(path, package_dirs=[folder])
        np.testing.assert_allclose(np.ptp(robot.full_mesh("b")[0], axis=0), 0.2, atol=1e-6)
    own = tmp_path / "ws" / "thing" / "urdf"
    own.mkdir()
    for name in ("package://thing/meshes/b.stl", "../meshes/b.stl",
                 f"file://{meshes}/b.stl"):  # fmt: skip
        (own / "r.urdf").write_text(mesh_robot(name))
        assert px.load_robot(own / "r.urdf").link_names == ["a", "b"]
    with pytest.raises(px.ModelError, match="no such folder"):
        px.load_robot(path, package_dirs=[tmp_path / "missing"])


def test_visuals_are_placed_scaled_and_preferred(tmp_path: Path) -> None:
    import trimesh

    trimesh.creation.box((1, 1, 1)).export(tmp_path / "b.stl")
    inside = """<visual><origin xyz="1 2 3" rpy="0 0 1.5707963267948966"/><geometry>
        <mesh filename="b.stl" scale="0.1 0.2 -0.3"/></geometry></visual>
        <collision><geometry><sphere radius="5"/></geometry></collision>"""
    only = '<collision><geometry><cylinder radius="0.5" length="2"/></geometry></collision>'
    path = tmp_path / "r.urdf"
    path.write_text(
        robot_of(link("a", only), link("b", inside), joint("j", "a", "b"))
    )  # fmt: skip
    robot = px.load_robot(path)
    v, f = robot.full_mesh("b")
    np.testing.assert_allclose(v.min(axis=0), [0.9, 1.95, 2.85], atol=1e-6)
    np.testing.assert_allclose(v.max(axis=0), [1.1, 2.05, 3.15], atol=1e-6)
    volume = np.einsum("ij,ij->i", v[f[:, 0]], np.cross(v[f[:, 1]], v[f[:, 2]])).sum() / 6
    assert volume == pytest.approx(0.1 * 0.2 * 0.3)  # faces still look outwards
    v, _ = robot.full_mesh("a")
    np.testing.assert_allclose(np.ptp(v, axis=0), [1, 1, 2], atol=0.003)


def test_fixed_joints_are_folded_and_branches_kept(tmp_path: Path) -> None:
    shift = '<origin xyz="0 0 0.5" rpy="0 0 0"/>'
    slide = f'<axis xyz="0 1 0"/>{LIMIT}'
    path = tmp_path / "r.urdf"
    path.write_text(
        robot_of(
            link("world", ""), link("base_link"), link("arm"), link("palm"), link("left"),
            link("right"), link("tool0", ""),
            joint("mount", "world", "base_link", "fixed", '<origin xyz="0 0 7"/>'),
            joint("turn", "base_link", "arm", inside=f'{shift}<axis xyz="0 0 2"/>{LIMIT}'),
            joint("weld", "arm", "palm", "fixed", shift),
            joint("l", "palm", "left", "prismatic", slide),
            joint("r", "palm", "right", "prismatic", f'<axis xyz="0 -1 0"/>{LIMIT}'),
            joint("t", "palm", "tool0", "fixed", shift),
        )
    )  # fmt: skip
    robot = px.load_robot(path)
    assert robot.joint_names == ["turn", "l", "r"]
    assert robot.link_names[0] == "base_link"
    poses = dict(zip(robot.link_names, robot.link_poses([np.pi / 2, 0.1, 0.2]), strict=True))
    # The world is the frame of base_link, whatever that stands on.
    np.testing.assert_allclose(poses["palm"][:3, 3], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(poses["left"][:3, 3], [-0.1, 0, 1], atol=1e-12)
    np.testing.assert_allclose(poses["right"][:3, 3], [0.2, 0, 1], atol=1e-12)
    np.testing.assert_allclose(robot.tool_pose([0, 0, 0])[:3, 3], [0, 0, 1.5], atol=1e-12)
    at_world = px.load_robot(path, base="world").tool_pose([0, 0, 0])
    np.testing.assert_allclose(at_world[:3, 3], [0, 0, 8.5], atol=1e-12)


def test_several_chains_and_no_tool_ask_for_one(tmp_path: Path) -> None:
    path = tmp_path / "r.urdf"
    path.write_text(robot_of(*ARM, link("c"), joint("k", "a", "c")))
    with pytest.raises(px.ModelError, match=r"2 links carry no other: 'b', 'c'; tool= says"):
        px.load_robot(path)
    assert px.load_robot(path, tool="c").tool == "c"


HOSTILE = {
    "100 000 nested tags": lambda: "<robot>" + "<link>" * 100_000,
    "200 000 nested tags": lambda: "<robot>" + "<link>" * 200_000 + "</link>" * 200_000,
    "200 000 links in a chain": lambda: robot_of(
        *(link(f"l{i}", "") for i in range(200_000)),
        *(joint(f"j{i}", f"l{i}", f"l{i + 1}") for i in range(199_999)),
    ),
    "a billion laughs": lambda: (
        "<!DOCTYPE r ["
        + '<!ENTITY a "ha">'
        + "".join(f'<!ENTITY {chr(98 + i)} "{f"&{chr(97 + i)};" * 10}">' for i in range(9))
        + "]><robot>&j;</robot>"
    ),
}

MEASURE = """
import resource, sys, time
import pinocchio, trimesh, xacrodoc
import proxcgal as px
peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
before, start = peak(), time.process_time()
try:
    px.load_robot(sys.argv[1])
except px.ModelError as error:
    print(time.process_time() - start, peak() - before, str(error)[-80:], sep="|")
"""


@pytest.mark.parametrize("what", HOSTILE)
def test_hostile_depth_and_size_are_refused_at_little_cost(tmp_path: Path, what: str) -> None:
    path = tmp_path / "hostile.urdf"
    path.write_text(HOSTILE[what]())
    run = [sys.executable, "-c", MEASURE, str(path)]
    done = subprocess.run(run, capture_output=True, text=True, check=True)
    seconds, megabytes, said = done.stdout.split("|")
    assert float(seconds) < 1
    assert float(megabytes) < 256
    assert re.search("deeper than|more than|document type", said)

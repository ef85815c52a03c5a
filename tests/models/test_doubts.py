"""What is left out, made fixed, asked for or doubted, by name; and what `robots check` says."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import proxcgal as px
from proxcgal.cli.main import main
from proxcgal.models.description import Joint
from proxcgal.models.formats.parts import motion
from proxcgal.models.robots import describe_robot
from proxcgal.study.robot_picture import picture

BOX = '<visual><geometry><box size="{}"/></geometry></visual>'


def link(name: str, size: str | None = ".1 .1 .1") -> str:
    return f'<link name="{name}">{BOX.format(size) if size else ""}</link>'


def joint(
    name: str, parent: str, child: str, low: str = "-1", high: str = "1", kind: str = "revolute",
    xyz: str = "0 0 .3", speed: str = "1",
) -> str:  # fmt: skip
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy=".1 .2 .3"/><axis xyz="0 1 1"/>'
        f'<limit lower="{low}" upper="{high}" velocity="{speed}" effort="1"/></joint>'
    )


def write(folder: Path, *parts: str) -> Path:
    path = folder / "r.urdf"
    path.write_text(f'<robot name="r">{"".join(parts)}</robot>')
    return path


def said(path: Path, **options: object) -> tuple[px.Robot, list[str]]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        robot = px.load_robot(path, vertices_per_link=None, **options)  # type: ignore[arg-type]
    return robot, [str(w.message) for w in caught]


ARM = (link("a"), link("b"), joint("j", "a", "b"))


def test_a_sound_robot_is_not_doubted(tmp_path: Path) -> None:
    assert said(write(tmp_path, *ARM))[1] == []


@pytest.mark.parametrize(
    "shape",
    ['<sphere radius="0"/>', '<cylinder radius="0" length="1"/>', '<box size="0 1 1"/>',
     '<cylinder radius="1" length="0"/>', '<mesh filename="none.stl" scale="0 0 0"/>'],
)  # fmt: skip
def test_placeholders_are_left_out_with_a_warning(tmp_path: Path, shape: str) -> None:
    empty = f'<link name="c"><visual><geometry>{shape}</geometry></visual></link>'
    path = write(tmp_path, *ARM, empty, joint("k", "b", "c"))
    for _ in range(2):  # from the cache too
        robot, notes = said(path)
        assert robot.link_names == ["a", "b"]
        assert notes == [f"{path}: link 'c': a shape of size 0 is left out"]


def test_a_placeholder_gives_way_to_the_collision_shape(tmp_path: Path) -> None:
    inside = (
        '<visual><geometry><sphere radius="0"/></geometry></visual>'
        '<collision><geometry><box size="1 1 1"/></geometry></collision>'
    )
    path = write(tmp_path, *ARM, f'<link name="c">{inside}</link>', joint("k", "b", "c"))
    robot, _ = said(path)
    assert robot.full_mesh("c")[0].max() == 0.5


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_a_locked_joint_becomes_a_fixed_one_where_it_stands(tmp_path: Path, kind: str) -> None:
    parts = (*ARM, link("c"), joint("k", "b", "c", "{0}", "{1}", kind), link("d"),
             joint("m", "c", "d", xyz=".1 0 0"))  # fmt: skip
    free = px.load_robot(
        write(tmp_path, *(p.format("-1", "1") for p in parts)), vertices_per_link=None
    )
    (tmp_path / "locked").mkdir()
    robot, notes = said(write(tmp_path / "locked", *(p.format("0.4", "0.4") for p in parts)))
    assert robot.joint_names == ["j", "m"]
    assert "joint 'k': lower = upper, taken as fixed" in notes[0]
    for q in np.random.default_rng(0).uniform(-1, 1, (5, 2)):
        right = free.link_poses([q[0], 0.4, q[1]])
        np.testing.assert_allclose(robot.link_poses(q), right, atol=1e-12)
        np.testing.assert_allclose(robot.tool_pose(q), free.tool_pose([q[0], 0.4, q[1]]),
                                   atol=1e-12)  # fmt: skip


def test_nothing_but_locked_joints_is_refused(tmp_path: Path) -> None:
    with pytest.raises(px.ModelError, match="no moving joint; 'j' are locked"):
        px.load_robot(write(tmp_path, link("a"), link("b"), joint("j", "a", "b", "0", "0")))


def test_several_ends_on_one_joint_are_asked_for(tmp_path: Path) -> None:
    ends = "".join(
        f'<link name="{name}"/><joint name="to_{name}" type="fixed"><parent link="b"/>'
        f'<child link="{name}"/></joint>'
        for name in ("left", "right")
    )
    path = write(tmp_path, *ARM, ends)
    with pytest.raises(px.ModelError, match="2 links carry no other: 'left', 'right'; tool= says"):
        px.load_robot(path)
    assert px.load_robot(path, tool="left").tool == "left"
    assert px.load_robot(write(tmp_path, *ARM, ends.replace("left", "tool0"))).tool == "tool0"


def test_an_end_that_no_joint_moves_is_no_candidate(tmp_path: Path) -> None:
    still = '<link name="camera"/><joint name="f" type="fixed"><parent link="a"/>' \
            '<child link="camera"/></joint>'  # fmt: skip
    assert px.load_robot(write(tmp_path, *ARM, still)).tool == "b"


DOUBTED = {
    "a large link": ((link("a"), link("b", "6 1 1"), joint("j", "a", "b")),
                     r"link 'b' \(6 m\) is larger than 5 m"),
    "a small link": ((link("a"), link("b", "1e-4 1e-4 1e-4"), joint("j", "a", "b")),
                     r"link 'b' \(0\.0001 m\) is smaller than 1 mm"),
    "far origins": ((*ARM, link("c"), joint("k", "b", "c", xyz="0 0 300")),
                    r"joint 'k' \(300 m\) is farther than 5 m"),
    "degrees": ((link("a"), link("b"), joint("j", "a", "b", "-170", "170")),
                r"joint 'j' \(170 rad\) turns that far; are its limits in degrees"),
    "degrees a second": ((link("a"), link("b"), joint("j", "a", "b", speed="120")),
                         r"joint 'j' \(120 rad/s\) is that fast"),
}  # fmt: skip


@pytest.mark.parametrize("what", DOUBTED)
def test_what_looks_like_a_mistake_is_said_with_its_names(tmp_path: Path, what: str) -> None:
    parts, match = DOUBTED[what]
    path = write(tmp_path, *parts)
    with pytest.warns(px.ModelWarning, match=match):
        px.load_robot(path, vertices_per_link=None)


@pytest.mark.parametrize("name", ["ur10e", "panda", "kr150"])
def test_the_built_in_robots_are_not_doubted(name: str) -> None:
    from proxcgal.models.doubts import doubts

    assert doubts(describe_robot(name)) == []


def test_check_prints_and_draws_what_was_understood(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path, *ARM, link("c", "6 .1 .1"), joint("slide", "b", "c", "0", ".25",
                                                            "prismatic"))  # fmt: skip
    assert main(["robots", "check", str(path), "--out", str(tmp_path / "out")]) == 0
    text = capsys.readouterr().out
    for part in ("2 joints, 3 links", "tool: 'c'", "j: b*", "slide: c*", "-57.3 deg", "0.25 m",
                 "6.000 x 0.100 x 0.100", "link 'c' (6 m) is larger than 5 m"):  # fmt: skip
        assert part in text
    with Image.open(tmp_path / "out" / "r.png") as image:
        assert image.width > 1000


def test_check_reads_a_robot_without_speed_limits_and_tool(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path, *ARM, link("c"), joint("k", "a", "c", speed="0"))
    assert main(["robots", "check", str(path), "--no-picture"]) == 0
    text = capsys.readouterr().out
    assert "tool: not said; one of 'b', 'c'" in text
    assert "joint 'k': no speed limit" in text


@pytest.mark.parametrize(
    ("words", "match"),
    [(["check"], "a file is needed"), (["list", "x.urdf"], "takes no file"),
     (["check", "no.urdf"], "no such file"), (["check", "a.xacro", "--xacro-arg", "b"],
                                              "--xacro-arg b: name=value")],
)  # fmt: skip
def test_check_refuses_in_one_line(
    words: list[str], match: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["robots", *words]) == 2
    error = capsys.readouterr().err
    assert match in error
    assert error.count("\n") == 1


def test_a_picture_shows_what_is_in_front() -> None:
    wall = np.array([[1.0, -1, -1], [1, 1, -1], [1, 1, 1], [1, -1, 1]])
    tilted = wall * [0, 1, 1] + [-1, 0, 0] + np.outer(wall[:, 1], [1.0, 0, 0])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    image, width = picture({"behind": (tilted, faces), "front": (wall, faces)}, (0.0, 0.0))
    assert width == pytest.approx(2.16)
    assert image[130, 130] == pytest.approx(0.85)  # the wall faces the eye
    assert image[0, 0] == 1.0  # nothing


def test_motion_of_a_joint_is_that_of_the_core(tmp_path: Path) -> None:
    robot = px.load_robot(write(tmp_path, *ARM), vertices_per_link=None)
    j: Joint = robot.description.joints[0]
    q = 0.7
    np.testing.assert_allclose(
        j.origin @ motion(j.type, j.axis, q) @ robot.description.links[1].T_JL,
        robot.link_poses([q])[1], atol=1e-12,
    )  # fmt: skip


def test_poses_whose_rotation_was_rounded_are_made_rigid(tmp_path: Path) -> None:
    robot = px.load_robot(write(tmp_path, *ARM), vertices_per_link=None)
    w, x, y, z = np.round([0.8536, 0.1464, 0.3536, 0.3536], 4)
    R = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    assert 1e-6 < np.abs(R @ R.T - np.eye(3)).max() < 1e-3
    pose = np.eye(4)
    pose[:3, :3] = R
    both = px.attach(robot, "b", robot, pose, ("p_", "q_"))
    T = np.asarray(both.tool_pose([0.0, 0.0]))[:3, :3]
    np.testing.assert_allclose(T @ T.T, np.eye(3), atol=1e-12)
    pose[0, 0] += 0.01
    with pytest.raises(px.ModelError, match="a rotation and a translation"):
        px.attach(robot, "b", robot, pose, ("p_", "q_"))

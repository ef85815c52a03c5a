"""Scenario files: what is valid, and how everything that is not gets told."""

import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenario_keys import rows_of, updated

from proxcgal import _core
from proxcgal.core import toml
from proxcgal.core.errors import ConfigError
from proxcgal.scenario.joint_scenario import JointScenario
from proxcgal.scenario.loading import KINDS, list_scenarios, load_scenario, parse_scenario
from proxcgal.scenario.scenario import Scenario
from proxcgal.scenario.setup import Setup

DOCS = Path(__file__).parents[2] / "docs" / "scenarios.md"

MINIMAL = """
kind = "static"
robot = "ur10e"
q0 = [0, 0, 0, 0, 0, 0]
duration = 1
[goal]
offset = [0.1, 0, 0]
[[skin.rings]]
link = "forearm_link"
at = [0.5]
sensors = 10
"""


def told(text: str, *overrides: str) -> list[str]:
    with pytest.raises(ConfigError) as error:
        parse_scenario('name = "x"\n' + text, "x.toml", overrides)
    return str(error.value).splitlines()


def test_every_built_in_scenario_loads_and_is_described() -> None:
    listed = list_scenarios()
    assert {"front_plane", "side_plane"} <= set(listed)
    for name, line in listed.items():
        assert load_scenario(name).name == name
        assert line


def test_front_panel_stands_where_the_experiment_puts_it() -> None:
    front = load_scenario("front_plane")
    assert front.q0 == (0.0, -1.9, 2.8, -2.47, -1.57, 0.0)
    assert front.duration == 12.0
    assert front.goal.offset == (0.75, 0.0, 0.0)
    (panel,) = front.obstacles
    assert panel.size == (0.02, 1.0, 1.0)
    assert panel.position[2] == 0.6


def test_side_panel_stands_where_the_experiment_puts_it() -> None:
    side = load_scenario("side_plane")
    assert side.q0 == (0.3, -1.7, 1.9, -1.7, -1.57, 0.0)
    assert side.duration == 20.0
    assert side.goal.offset == (0.0, -1.10, 0.0)
    (panel,) = side.obstacles
    assert panel.size == (1.2, 0.02, 1.0)
    assert panel.position == (0.5, -0.55, 0.6)


@pytest.mark.parametrize("name", ["front_plane", "side_plane"])
def test_both_planes_have_three_rings_of_ten_round_the_forearm(name: str) -> None:
    (ring,) = load_scenario(name).skin.rings
    assert (ring.link, ring.at, ring.sensors) == ("forearm_link", (0.2, 0.5, 0.8), 10)


@pytest.mark.parametrize("name", sorted(list_scenarios()))
def test_resolved_text_gives_the_same_scenario_again(name: str) -> None:
    fault = ["fault=[{kind='delay', from=1.0, to=2.0, sensor=3}]"]
    has_sensors = load_scenario(name).kind != "walkthrough"
    scenario = load_scenario(name, fault if has_sensors else ())
    assert parse_scenario(scenario.to_toml(), "again") == scenario


def test_resolved_text_has_every_default_written_out() -> None:
    table = tomllib.loads(parse_scenario('name = "x"' + MINIMAL, "x").to_toml())
    assert table["controller"]["filter"]["tolerance"] == _core.FilterConfig().tolerance
    assert table["simulation"]["sensor_hz"] == 15.0


@pytest.mark.parametrize(
    ("key", "struct", "attribute"),
    [
        ("d_min", "Avoidance", "d_min"),
        ("buffer", "Avoidance", "buffer"),
        ("avoid_gain", "Avoidance", "gain"),
        ("reach_gain", "Reach", "gain"),
        ("max_linear", "Reach", "max_linear"),
        ("max_angular", "Reach", "max_angular"),
        ("min_row_norm", "ControllerConfig", "min_row_norm"),
    ],
)
def test_control_defaults_are_those_of_the_core(key: str, struct: str, attribute: str) -> None:
    scenario = load_scenario("front_plane")
    assert getattr(scenario.controller, key) == getattr(getattr(_core, struct)(), attribute)


def test_all_problems_are_told_at_once_one_line_each() -> None:
    lines = told(
        """
        kind = "static"
        robto = "ur10e"
        q0 = [1, 2, "x"]
        duration = -1
        perception = "seen"
        [goal]
        offset = [1, 2]
        [controller]
        d_min = "a"
        dmin = 3
        tasks = ["avoidance", "fly"]
        [controller.filter]
        z_min = nan
        [[skin.rings]]
        link = "x"
        at = [0.2, 2.0]
        sensors = 1.5
        [[obstacle]]
        size = [0, 1, 1]
        [[fault]]
        kind = "explode"
        [[fault]]
        kind = "silent"
        from = 3.0
        to = 1.0
        """,
        "seed=-1",
    )
    expected = [
        "x.toml: robot: missing",
        'x.toml: robto = "ur10e": unknown key; there are name, description, kind, robot',
        'x.toml: q0.2 = "x": must be a valid number',
        "x.toml: duration = -1: must be greater than 0",
        "x.toml: perception = \"seen\": must be 'sensed' or 'known'",
        "x.toml: goal.offset = [1, 2]: must have at least 3 items, not 2",
        'x.toml: controller.d_min = "a": must be a valid number',
        "x.toml: controller.dmin = 3: unknown key; there are d_min, buffer",
        "x.toml: controller.tasks.1 = \"fly\": must be 'avoidance', 'reach'",
        "x.toml: controller.filter.z_min: must not be nan",
        "x.toml: skin.rings.0.at.1 = 2.0: must be less than or equal to 1",
        "x.toml: skin.rings.0.sensors = 1.5: must be a valid integer",
        "x.toml: obstacle.0.size.0 = 0: must be greater than 0",
        "x.toml: obstacle.0.position: missing",
        "x.toml: fault.0.kind = \"explode\": must be 'silent', 'frozen'",
        "x.toml: fault.1: to = 1 must be later than from = 3",
        "x.toml: override seed = -1: must be greater than or equal to 0",
    ]
    missing = [start for start in expected if not any(line.startswith(start) for line in lines)]
    assert missing == []
    assert len(lines) == len(expected)


@pytest.mark.parametrize("text", ["offset = [0, 0, 0]\nposition = [0, 0, 0]", ""])
def test_goal_needs_exactly_one_form(text: str) -> None:
    (line,) = told(MINIMAL.replace("offset = [0.1, 0, 0]", text))
    assert "exactly one of offset, position and waypoints" in line


def test_a_key_with_a_hyphen_is_told_where_it_stands() -> None:
    (line,) = told(MINIMAL, "controller.max-linear=1")
    assert line.startswith(
        "x.toml: override controller.max-linear = 1: unknown key; there are d_min, buffer"
    )


def test_a_name_of_the_users_own_is_told_whatever_it_is() -> None:
    text = load_scenario("hri_task1").to_toml()
    with pytest.raises(ConfigError) as error:
        parse_scenario(text, "x.toml", ["operator.marks.float=[0, 1, 2]"])
    assert str(error.value).startswith("x.toml: override operator.marks.float = [0, 1, 2]: must")


def test_unknown_kind_lists_those_that_exist() -> None:
    (line,) = told(MINIMAL, "kind=maze")
    assert line == (
        "x.toml: override kind = \"maze\": must be 'static', 'hri', 'joint', 'walkthrough' or "
        "'guided'"
    )


def test_unknown_name_lists_the_scenarios() -> None:
    with pytest.raises(ConfigError, match=r"one of: front_plane, .*hri_task1, .*side_plane"):
        load_scenario("front_plan")


def test_what_is_not_toml_is_told_with_file_and_line(tmp_path: Path) -> None:
    path = tmp_path / "broken.toml"
    path.write_text("a = 1\nb = \n")
    with pytest.raises(ConfigError, match=r"broken\.toml: not TOML: .*line 2"):
        load_scenario(path)


def test_a_file_takes_its_own_name_and_its_paths_are_relative_to_it(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    text = MINIMAL.replace('"ur10e"', '"arm.urdf"\npackage_dirs = ["meshes"]')
    path.write_text(text)
    scenario = load_scenario(path)
    assert scenario.name == "mine"
    assert scenario.robot == str(tmp_path / "arm.urdf")
    assert scenario.package_dirs == (str(tmp_path / "meshes"),)


def test_overrides_take_toml_values_bare_strings_and_array_places() -> None:
    scenario = load_scenario(
        "front_plane",
        ["controller.d_min=0.3", "robot=panda", "obstacle.0.size=[0.1, 2, 2]", "seed=7"],
    )
    assert scenario.controller.d_min == 0.3
    assert scenario.robot == "panda"
    assert scenario.obstacles[0].size == (0.1, 2, 2)
    assert scenario.seed == 7


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("controller.d_min", "must have the form key.sub=value"),
        ("=3", "must have the form key.sub=value"),
        ("q0.9=1", "q0 has the entries 0 to 5, not 9"),
        ("q0.²=1", "q0 has the entries 0 to 5, not ²"),
        ("seed.deeper=1", "seed is no table"),
        ("seed=1\nduration=3", "must have one value, and no lines after it"),
        ("q0=" + 100 * "[" + 100 * "]", "must not be nested more than 64 deep"),
        ("q0=" + 3000 * "[", "must not be nested more than 64 deep"),
        (3000 * "a." + "a=1", "must not be nested more than 64 deep"),
    ],
)
def test_a_bad_override_is_told_as_it_was_given(override: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message) as error:
        load_scenario("front_plane", ["seed=1", override])
    assert repr(override) in str(error.value)


@pytest.mark.parametrize(
    "text", ["q0 = " + 3000 * "[", "q0 = " + 99 * "[" + 99 * "]", 2000 * "a." + "a = 1"]
)
def test_a_file_that_is_nested_without_end_is_told(text: str) -> None:
    assert told(text) == ["x.toml: must not be nested more than 64 deep"]


def test_an_override_may_have_a_value_of_several_lines() -> None:
    assert load_scenario("front_plane", ["obstacle.0.size=[0.1,\n2, 2]"]).obstacles[0].size[1] == 2


def test_an_override_is_told_as_one_however_its_key_is_written() -> None:
    (line,) = told(MINIMAL, "controller . d_min = -1")
    assert line.startswith("x.toml: override controller.d_min = -1: must be")
    (line,) = told(MINIMAL + "\n[[obstacle]]\nsize=[1,1,1]\nposition=[0,0,0]", "obstacle.00.size=1")
    assert line.startswith("x.toml: override obstacle.0.size = 1: ")


def test_scenarios_cannot_be_changed_once_loaded() -> None:
    with pytest.raises(ValueError, match="frozen"):
        load_scenario("front_plane").controller.d_min = 0.1  # type: ignore[misc]


VALUES = st.recursive(
    st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats(allow_nan=False)
    | st.text(st.characters(exclude_categories=["Cs"])),
    lambda inner: st.lists(inner, max_size=3),
    max_leaves=6,
)


@given(st.dictionaries(st.text(st.characters(exclude_categories=["Cs"])), VALUES, max_size=5))
def test_written_toml_reads_back_exactly(table: dict[str, object]) -> None:
    assert repr(tomllib.loads(toml.write({"top": table}))["top"]) == repr(table)


def test_places_may_have_any_name_and_resolved_text_keeps_it() -> None:
    scenario = load_scenario("hri_task1", ["operator.places.left shelf=[1, 2, 3]"])
    assert parse_scenario(scenario.to_toml(), "again") == scenario


def test_every_key_is_documented_with_its_default() -> None:
    text = DOCS.read_text()
    for kind in (Scenario, KINDS["hri"]):
        assert [row for row in rows_of(kind) if row not in text] == []
    joint = (DOCS.parent / "joint_robot.md").read_text()
    own = [row for row in rows_of(JointScenario) if "`configurations`" not in row]
    assert [row for row in own if row not in text + joint] == []


@pytest.mark.parametrize("page", ["scenarios.md", "walkthrough.md", "joint_robot.md"])
def test_the_tables_of_keys_say_what_the_schema_says(page: str) -> None:
    text = (DOCS.parent / page).read_text()
    assert updated(text) == text  # python docs/scenario_keys.py docs/*.md


def test_the_scenario_in_the_documentation_can_be_copied(tmp_path: Path) -> None:
    path = tmp_path / "copied.toml"
    path.write_text(DOCS.read_text().split("```toml\n")[1].split("```")[0])
    assert load_scenario(path).name == "copied"


@pytest.mark.parametrize(
    ("change", "allowed"),
    [
        ("duration=1e12", "100000"), ("simulation.control_hz=1e9", "10000"),
        ("simulation.sensor_hz=1e9", "10000"), ("seed=9223372036854775808", "9223372036854775808"),
    ],
)  # fmt: skip
def test_what_would_never_end_is_refused(change: str, allowed: str) -> None:
    with pytest.raises(ConfigError, match=f"{change.partition('=')[0]}.* less than .*{allowed}"):
        load_scenario("front_plane", [change])


def test_all_that_a_scenario_says_of_another_robot_is_told_at_once() -> None:
    scenario = load_scenario("front_plane", ["robot=panda", "controller.avoid_links=['nowhere']"])
    with pytest.raises(ConfigError) as told:
        Setup.of(scenario)
    assert "q0 has 6 values" in str(told.value)
    assert "skin.rings.0.link = 'forearm_link'" in str(told.value)
    assert "controller.avoid_links.0 = 'nowhere'" in str(told.value)

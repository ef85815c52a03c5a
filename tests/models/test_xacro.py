"""xacro: what decides is in the file, those it includes, its arguments and the environment."""

from pathlib import Path

import pytest

import proxcgal as px

SPACE = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
BODY = (
    '<link name="base_link"/><link name="l"><visual><geometry><box size=".1 .1 .1"/></geometry>'
    '</visual></link><joint name="j" type="revolute"><parent link="base_link"/><child link="l"/>'
    '<limit lower="-1" upper="{}" velocity="1" effort="1"/></joint>'
)


def write(path: Path, upper: str, before: str = "") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f'<robot name="r" {SPACE}>{before}{BODY.format(upper)}</robot>')
    return path


def upper(path: Path, **options: object) -> float:
    return float(px.load_robot(path, vertices_per_link=None, **options).q_max[0])  # type: ignore[arg-type]


ARGUMENT = '<xacro:arg name="up" default="0.5"/>'


def test_arguments_have_defaults_and_are_given(tmp_path: Path) -> None:
    path = write(tmp_path / "a.xacro", "$(arg up)", ARGUMENT)
    assert upper(path) == 0.5
    assert upper(path, xacro_args={"up": "1.25"}) == 1.25
    assert upper(path, xacro_args={"up": 2}) == 2
    assert upper(path) == 0.5


def test_truth_values_are_arguments(tmp_path: Path) -> None:
    path = write(tmp_path / "a.xacro", "${3 if far else 1}", '<xacro:arg name="far" default="0"/>'
                 '<xacro:property name="far" value="$(arg far)"/>')  # fmt: skip
    assert upper(path, xacro_args={"far": True}) == 3
    assert upper(path, xacro_args={"far": False}) == 1


def test_an_argument_that_is_missing_or_unknown_is_named(tmp_path: Path) -> None:
    path = write(tmp_path / "a.xacro", "$(arg up)")
    with pytest.raises(px.ModelError, match=r"argument 'up' .* xacro_args=.*--xacro-arg up="):
        upper(path)
    path = write(tmp_path / "a.xacro", "$(arg up)", ARGUMENT)
    with pytest.raises(px.ModelError, match="there is no argument 'pu'; there are 'up'"):
        upper(path, xacro_args={"pu": 1})


@pytest.mark.parametrize("given", ["up=1", {"up": [1]}, {1: "up"}])
def test_arguments_of_another_form_are_refused(tmp_path: Path, given: object) -> None:
    path = write(tmp_path / "a.xacro", "$(arg up)", ARGUMENT)
    with pytest.raises(px.ModelError, match="xacro_args"):
        upper(path, xacro_args=given)


def test_a_urdf_takes_no_arguments(tmp_path: Path) -> None:
    path = write(tmp_path / "a.urdf", "1")
    with pytest.raises(px.ModelError, match=r"xacro_args are for \.xacro files"):
        upper(path, xacro_args={"up": 1})


def test_files_are_relative_to_the_file_that_names_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Where it is evaluated is what counts, as xacro has it: here at once.
    inner = (
        '<xacro:property name="limits" value="${xacro.load_yaml(\'limits.yaml\')}" '
        'lazy_eval="false"/>'
    )
    (tmp_path / "own" / "sub").mkdir(parents=True)
    (tmp_path / "own" / "sub" / "limits.yaml").write_text("up: 3.5\n")
    (tmp_path / "own" / "sub" / "inner.xacro").write_text(f"<robot {SPACE}>{inner}</robot>")
    (tmp_path / "limits.yaml").write_text("up: 9.5\n")
    path = write(tmp_path / "own" / "a.xacro", "${limits['up']}",
                 '<xacro:include filename="sub/inner.xacro"/>')  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert upper(path) == 3.5
    monkeypatch.chdir(tmp_path / "own")
    assert upper(Path("a.xacro")) == 3.5


def test_a_failure_leaves_nothing_behind(tmp_path: Path) -> None:
    folder = Path.cwd()
    broken = write(tmp_path / "b.xacro", "1", '<xacro:include filename="no_such.xacro"/>')
    with pytest.raises(px.ModelError, match=r"b\.xacro: xacro: .*no_such\.xacro"):
        upper(broken)
    assert upper(write(tmp_path / "a.xacro", "${2 * 0.75}")) == 1.5
    assert Path.cwd() == folder


def test_the_environment_and_included_files_are_noticed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("PX_TEST_UP", raising=False)
    path = write(tmp_path / "a.xacro", "$(optenv PX_TEST_UP 0.5)")
    assert upper(path) == 0.5
    monkeypatch.setenv("PX_TEST_UP", "2.5")
    assert upper(path) == 2.5
    limits = tmp_path / "limits.yaml"
    path = write(tmp_path / "b.xacro", "${xacro.load_yaml('limits.yaml')['up']}")
    for value in (1.5, 2.5):
        limits.write_text(f"up: {value}\n")
        assert upper(path) == value


def test_an_included_file_that_appears_is_noticed(tmp_path: Path) -> None:
    path = write(tmp_path / "a.xacro", "${up}", '<xacro:property name="up" value="1"/>'
                 '<xacro:include filename="more_*.xacro"/>')  # fmt: skip
    assert upper(path) == 1
    (tmp_path / "more_a.xacro").write_text(
        f'<robot {SPACE}><xacro:property name="up" value="2"/></robot>'
    )
    assert upper(path) == 2


def test_its_own_package_is_found(tmp_path: Path) -> None:
    package = tmp_path / "folder_of_another_name"
    (package / "config").mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>my_arm</name></package>")
    (package / "config" / "limits.yaml").write_text("up: 2.25\n")
    path = write(package / "urdf" / "a.xacro",
                 "${xacro.load_yaml('$(find my_arm)/config/limits.yaml')['up']}")  # fmt: skip
    assert upper(path) == 2.25
    with pytest.raises(
        px.ModelError, match=r"b\.xacro: xacro: package 'other' is not found; package_dirs"
    ):
        upper(write(package / "urdf" / "b.xacro", "$(find other)"))


def test_work_without_end_is_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from proxcgal.models.formats import child

    monkeypatch.setattr(child, "MAX_SECONDS", 1.0)
    path = write(tmp_path / "a.xacro", "${len([x for x in range(10**12)])}")
    with pytest.raises(px.ModelError, match=r"a\.xacro: .*takes more than 1 s|a\.xacro: "):
        upper(path)


def test_too_much_memory_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "a.xacro", "${len('x' * (3 * 10**9))}")
    with pytest.raises(px.ModelError, match=r"a\.xacro: ") as caught:
        upper(path)
    assert "emory" in str(caught.value)

"""What is typed wrong is told in a line, before anything runs."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from proxcgal_ros import cli
from proxcgal_ros.action import _in_ros


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["sim", "nowhere"], "scenario 'nowhere'"),
        (["sim", "front_plane", "--seed", "-1"], "seed = -1"),
        (["sim", "walkthrough_teach"], "it takes no velocities and carries no sensors"),
        (["sim", "front_plane", "--out", "file/below.json"], "--out file/below.json: cannot be"),
        (["sim", "front_plane", "--out", "."], "--out .: cannot be written"),
        (["sim", "front_plane", "--set", "controller.d_min=-1"], "controller.d_min"),
        (["bag", "file", "bag"], "not a recording"),
        (["replay", "nowhere"], "bag nowhere: no such file or folder"),
        (["node", "--ros-args", "d_min:=0.3"], "--ros-args -p NAME:=VALUE"),
    ],
)
def test_bad_input_is_one_line_and_exit_2_and_writes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    arguments: list[str], told: str,
) -> None:  # fmt: skip
    (tmp_path / "file").write_text("not a folder")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["proxcgal_ros", *arguments])
    assert cli.main() == 2
    said = capsys.readouterr().err
    assert said.startswith("error: ")
    assert said.count("\n") == 1
    assert told in said
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_reasons_name_the_fields_of_the_action() -> None:
    assert _in_ros("init = 'zzz': there are free, jl") == (
        "init_config_name = 'zzz': there are free, jl"
    )
    assert _in_ros("frame = 'base': must be one of kuka_base").startswith("frame = ")

"""What a campaign leaves in its folder: the table, the report, recordings of the worst."""

import json
import shlex
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import polars as pl
import pytest

import proxcgal as px
from proxcgal.cli import main
from proxcgal.recording.reader import read_recording
from proxcgal.recording.replay import first_difference
from proxcgal.scenario.loading import load_scenario
from proxcgal.study.motion_picture import draw_moving
from proxcgal.study.workers import Pool
from proxcgal.study.worst_recordings import record_worst

SMALL = ("--scenario", "front_plane", "--runs", "2", "--set", "duration=0.2", "--workers", "1")
ONE = (*SMALL[:3], "1", *SMALL[4:])

Call = Callable[..., Any]


@pytest.fixture
def call(call: Call) -> Call:
    """`proxcgal campaign static` in an empty folder."""
    return partial(call, "campaign", "static", "--quiet")


def summary(folder: Path) -> bytes:
    return (folder / "summary.json").read_bytes()


def trial_files(folder: Path) -> dict[str, int]:
    """When each finished trial was written."""
    return {path.name: path.stat().st_mtime_ns for path in (folder / "trials").glob("*.json")}


def test_the_table_has_a_row_a_trial(whole: Path) -> None:
    table = pl.read_parquet(whole / "trials.parquet")
    assert table.shape[0] == 8
    assert table["key"].n_unique() == 8
    assert table["controller"].to_list() == ["wb", "sm", "wb_known", "wb_memory"] * 2
    for row in table.iter_rows(named=True):
        scenario = load_scenario("front_plane", shlex.split(row["command"])[8:])
        assert scenario.obstacles[0].position[0] == row["panel_x_m"]
        assert scenario.q0[5] == row["q0_5"]


def test_the_command_beside_a_recording_repeats_it(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    entry = json.loads(summary(whole))["worst"][0]
    table = pl.read_parquet(whole / "trials.parquet").filter(pl.col("name") == entry["name"])
    words = shlex.split(entry["command"])
    assert words[0] == "proxcgal"
    assert main.main([*words[1:], "--no-picture", "--quiet", "--out", "again"]) == 0
    again = json.loads(Path("again/summary.json").read_text())["controllers"]["wb"]
    for key, value in again.items():
        assert value == table[key][0]


def test_a_kept_recording_holds_the_ticks_with_scans_and_cannot_be_computed_again(
    whole: Path,
) -> None:
    entry = json.loads(summary(whole))["worst"][0]
    recording = read_recording(whole / entry["recording"])
    assert recording.damage is None
    assert recording.settings.ticks == "scans"
    assert [tick.inputs.time for tick in recording.ticks] == pytest.approx([0.0, 0.07, 0.14])
    assert all(len(tick.inputs.scans) == 30 for tick in recording.ticks)
    with pytest.raises(px.ConfigError, match="every tick only"):
        first_difference(recording)


def test_a_recording_that_is_there_is_not_made_again_and_every_tick_kept_where_asked_for(
    call: Call,
) -> None:
    arguments = (*ONE, "--keep", "worst:1", "--out", "here")
    assert call(*arguments).code == 0
    file = next(Path("here/recordings").iterdir())
    before = file.stat()
    assert call(*arguments).code == 0
    assert (file.stat().st_ino, file.stat().st_mtime_ns) == (before.st_ino, before.st_mtime_ns)
    assert call(*arguments, "--every-tick").code == 0
    recording = read_recording(file)
    assert len(recording.ticks) == 20
    assert first_difference(recording) is None


@pytest.mark.parametrize("raises", [True, False])
def test_a_recording_that_fails_is_told_and_costs_no_result(
    call: Call, monkeypatch: pytest.MonkeyPatch, raises: bool
) -> None:
    def simulate(*_: object, recording: Path, **__: object) -> object:
        recording.parent.mkdir(parents=True)
        recording.touch()
        if raises:
            raise px.SimulationError("disk full")
        return SimpleNamespace(recording_failure="disk full")

    monkeypatch.setattr("proxcgal.study.worst_recordings.simulate_trial", simulate)
    answer = call(*ONE, "--keep", "worst:1", "--out", "here")
    assert answer.code == 1
    assert answer.err == "proxcgal: front_plane-0-wb: not recorded: disk full\n"
    assert list(Path("here/recordings").iterdir()) == []
    told = json.loads(summary(Path("here")))["worst"]
    assert [(entry["name"], entry["error"]) for entry in told] == [
        ("front_plane-0-wb", "disk full")
    ]
    assert pl.read_parquet("here/trials.parquet").shape[0] == 4
    assert "not recorded: disk full" in Path("here/report.html").read_text()


def test_recordings_of_other_trials_go_half_ones_too(tmp_path: Path) -> None:
    (tmp_path / "recordings").mkdir()
    for name in ("a.mcap", ".a.mcap"):
        (tmp_path / "recordings" / name).touch()
    with Pool(1) as pool:
        assert record_worst([], tmp_path, "scans", pool, quiet=True) == []
    assert list((tmp_path / "recordings").iterdir()) == []


def test_more_runs_go_on_where_fewer_ended(call: Call, whole: Path) -> None:
    assert call(*ONE, "--keep", "none", "--out", "here").code == 0
    before = trial_files(Path("here"))
    assert len(before) == 4
    more = (*SMALL, "--keep", "worst:1", "--out", "here")
    assert call(*more).code == 0
    after = trial_files(Path("here"))
    assert {name: after[name] for name in before} == before
    assert summary(Path("here")) == summary(whole)


def test_a_report_is_made_again_from_the_folder(whole: Path) -> None:
    before = (whole / "report.html").read_bytes()
    assert main.main(["report", str(whole)]) == 0
    assert (whole / "report.html").read_bytes() == before
    assert before.count(b"<img ") == 2


def test_a_picture_that_was_on_its_way_when_its_process_was_killed_goes(tmp_path: Path) -> None:
    (tmp_path / ".drawing-x").mkdir()
    (tmp_path / ".drawing-x" / "0.mcap").touch()
    with Pool(1) as pool:
        draw_moving([], tmp_path, pool, quiet=True)
    assert list(tmp_path.iterdir()) == []

"""The 3D replay of a report, in a real browser that opens a file."""

import base64
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from browser import Tab, until
from test_report import checked, make_run

from proxcgal.recording.writer import Recorder
from proxcgal.report.write_report import write_report
from proxcgal.scenario.loading import load_scenario
from proxcgal.trial.trial import run_trial
from proxcgal.viewer.report_scene import replay_scene, still_scene


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = make_run(tmp_path_factory.mktemp("report") / "run")
    for name, duration in (("wb", 1.0), ("sm", 0.8)):
        scenario = load_scenario("front_plane", [f"duration={duration}"])
        with Recorder(folder / f"{name}.mcap") as recorder:
            run_trial(scenario, name, recorder=recorder)
    return folder


def test_a_report_opened_from_a_file_plays_in_3d_and_the_console_has_no_error(
    folder: Path, open_tab: Callable[[], Tab], tmp_path: Path
) -> None:
    path = write_report(folder)
    assert path.stat().st_size < 10_000_000
    tab = open_tab()
    tab.open(path.as_uri())
    tab.page.get_by_role("button", name="play the run in 3D").click()
    frame = tab.page.frame_locator("figure.replay iframe")
    frame.locator("canvas").first.wait_for()
    time = frame.locator("input").first
    shown = time.input_value()
    assert until(lambda: time.input_value() != shown)  # it plays
    frame.locator("canvas").first.scroll_into_view_if_needed()
    tab.picture("report", tmp_path)
    assert tab.errors == []
    assert {request for request in tab.requests if not request.startswith("blob:")} == {
        path.as_uri()
    }
    tab.page.close()


def test_the_page_without_its_scripts_is_as_well_formed_as_before(folder: Path) -> None:
    page = checked(write_report(folder))
    assert page.tags.count("iframe") == 0
    assert page.tags.count("button") == 1
    assert all(address.startswith("data:") for address in page.fetched)


def test_both_arms_are_in_the_scene_and_the_shorter_run_waits_at_its_end(folder: Path) -> None:
    scene, names = replay_scene([folder / "wb.mcap", folder / "sm.mcap"])
    assert names == ("wb", "sm")
    assert len(scene) < 1_000_000


def test_what_cannot_be_played_is_said_in_its_place(tmp_path: Path) -> None:
    folder = make_run(tmp_path / "run")  # its recording is empty
    text = checked(write_report(folder)).text
    assert "No 3D replay: recording" in text
    assert "not a recording" in text


def test_a_campaign_plays_its_worst(whole: Path) -> None:
    page = checked(write_report(whole))
    assert page.tags.count("button") == 1
    assert "play the run in 3D" in page.text


def test_a_sweep_shows_the_posture_that_was_timed(tmp_path: Path) -> None:
    cell: dict[str, Any] = {
        "robot": "ur10e", "vertices": 100, "cloud": "raw", "points": 1632, "algorithm": 2,
        "median_us": 1.0, "p99_us": 2.0, "max_us": 3.0,
    }  # fmt: skip
    cells = [cell | {"method": method} for method in ("paper", "fast")]
    (tmp_path / "summary.json").write_text(json.dumps({"machine": "x", "cells": cells}))
    page = checked(write_report(tmp_path))
    assert "show timing_ur10e in 3D" in page.text
    assert len(base64.b64encode(still_scene("timing_ur10e"))) < 2_000_000

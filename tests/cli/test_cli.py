"""What is typed runs, what is wrong is told in a line, nothing is half-written."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import proxcgal as px
from proxcgal.cli import main
from proxcgal.cli.replay import ReplayOptions, opens_page
from proxcgal.core.files import write_json
from proxcgal.recording.reader import read_recording
from proxcgal.scenario.loading import load_scenario
from proxcgal.scenario.setup import Setup
from proxcgal.study import motion_picture
from proxcgal.study.runs.pictures import draw_motion

QUICK = ["--set", "duration=0.4", "--quiet"]
PROGRAM = [sys.executable, "-c", "import sys; from proxcgal.cli.main import main; sys.exit(main())"]


Call = Callable[..., Any]


@pytest.fixture(scope="session")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short run of two controllers."""
    folder = tmp_path_factory.mktemp("results") / "run"
    arguments = ["run", "front_plane", "--controller", "wb", "sm", "--out", str(folder)]
    assert main.main([*arguments, "--workers", "1", "--no-picture", *QUICK]) == 0
    return folder


# --- Help and lists


def test_help_names_every_command(call: Call) -> None:
    answer = call("--help")
    assert answer.code == 0
    for command in main.COMMANDS:
        assert re.search(rf"^  {command}\b", answer.out, re.MULTILINE)


def test_help_comes_without_loading_what_only_runs_need() -> None:
    heavy = {"mujoco", "matplotlib", "pinocchio", "trimesh", "tyro", "scipy", "pydantic"}
    code = (
        "import sys; from proxcgal.cli.main import main; main(['--help']);"
        f"print('loaded:', sorted({heavy!r} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.endswith("loaded: []\n")


@pytest.mark.parametrize("command", main.COMMANDS)
def test_every_command_helps_with_an_example(call: Call, command: str) -> None:
    answer = call(command, "--help")
    assert answer.code == 0
    assert f"proxcgal {command}" in answer.out.partition("Examples:")[2]


def test_no_command_is_bad_input_and_shows_the_help(call: Call) -> None:
    answer = call()
    assert answer.code == 2
    assert "usage: proxcgal" in answer.err


def test_coverage_of_an_arm_without_sensors_is_refused(call: Call, tmp_path: Path) -> None:
    answer = call("coverage", "walkthrough_teach", "--out", str(tmp_path / "out"))
    assert answer.code == 2
    assert answer.err.count("\n") == 1
    assert "no sensors" in answer.err
    assert not (tmp_path / "out").exists()


def test_an_unknown_command_is_told_with_the_nearest_one(call: Call) -> None:
    answer = call("reply")
    assert answer.code == 2
    assert answer.err.count("\n") == 1
    assert "did you mean replay?" in answer.err


def test_version_tells_what_results_depend_on(call: Call) -> None:
    answer = call("--version")
    assert answer.code == 0
    assert answer.out.startswith("proxcgal 0")
    assert "mujoco" in answer.out


def test_scenarios_and_robots_are_listed_with_a_line_each(call: Call) -> None:
    scenarios = call("scenarios").out
    assert re.search(r"^front_plane +\S", scenarios, re.MULTILINE)
    assert re.search(r"^side_plane +\S", scenarios, re.MULTILINE)
    robots = call("robots").out
    for name in ("ur10e", "panda", "kr150"):
        assert re.search(rf"^{name} +\S", robots, re.MULTILINE)


# --- Bad input


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["run", "front_plane", "--controller", "ws"],
         "--controller ws: must be one of wb, sm, wb_known, wb_memory"),
        (["run", "front_plane", "--controller", "None"],
         "--controller None: must be one of wb, sm, wb_known, wb_memory"),
        (["campaign", "hri", "--seed=None"], "--seed None: must be a whole number"),
        (["run", "front_plane", "--subject", "nan"], "--subject nan: must be a whole number"),
        (["view", "front_plane", "--port", "abc"], "--port abc: must be a whole number"),
        (["replay", "x.mcap", "--at", "soon"], "--at soon: must be a number"),
        (["replay", "x.mcap", "--at"], "--at: value missing: must be a number"),
        (["campaign", "dynamic"],
         "KIND dynamic: must be one of static, faults, walkthrough, joint, hri"),
        (["run", "front_plane", "--controler", "sm"],
         "--controler: not known; did you mean --controller?"),
        (["run", "front_plane", "more"],
         "more: not known; proxcgal run --help tells what there is"),
        (["run"], "SCENARIO: missing; proxcgal run --help tells what it is"),
    ],
)  # fmt: skip
def test_what_the_parser_refuses_is_one_line(call: Call, words: list[str], told: str) -> None:
    answer = call(*words)
    assert (answer.code, answer.out, answer.err) == (2, "", f"proxcgal: {told}\n")


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["run", "no_such_scene"], ["front_plane"]),
        (["run", "front_plane", "--robot", "ur11e"], ["ur10e"]),
        (["run", "front_plane", "--robot", "nowhere.urdf"], ["nowhere.urdf"]),
        (["run", "front_plane", "--set", "controller.d_min=-1"], ["controller.d_min", "-1"]),
        (["run", "front_plane", "--set", "durration=3"], ["durration", "duration"]),
        (["run", "front_plane", "--set", "duration"], ["key.sub=value"]),
        (["run", "front_plane", "--set"], ["--set: given without a value"]),
        (["run", "front_plane", "--package-dir"], ["--package-dir: given without a value"]),
        (["run", "front_plane", "--robot", "panda"], ["q0 has 6 values"]),
        (["run", "front_plane", "--controller", "ws"], ["ws"]),
        (["run", "walkthrough_teach", "--controller", "sm"], ["--controller", "no controllers"]),
        (["run", "front_plane", "--subject", "3"], ["--subject 3", "no operator"]),
        (["run", "front_plane", "--seed", "-1"], ["seed", "-1"]),
        (["run", "front_plane", "--workers", "0"], ["--workers 0", "1 or more"]),
        (["run"], ["SCENARIO"]),
        (["demo", "--workers", "-2"], ["--workers -2"]),
        (["replay", "nothing.mcap"], ["nothing.mcap"]),
        (["report", "nowhere"], ["nowhere", "no such folder"]),
    ],
)
def test_bad_input_is_exit_2_without_traceback_and_writes_nothing(
    call: Call, tmp_path: Path, arguments: list[str], told: list[str]
) -> None:
    answer = call(*arguments)
    assert answer.code == 2
    assert answer.out == ""
    assert "Traceback" not in answer.err
    for word in told:
        assert word in answer.err
    assert list(tmp_path.iterdir()) == []


def test_every_problem_of_a_scenario_has_its_line(call: Call, tmp_path: Path) -> None:
    answer = call(
        "run", "front_plane", "--set", "controller.d_min=0", "controller.gian=1",
        "--set", "simulation.dropout=2",
    )  # fmt: skip
    assert answer.code == 2
    assert len(answer.err.splitlines()) == 3
    assert all(line.startswith("proxcgal: ") for line in answer.err.splitlines())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("place", ["file", "file/below", "/proc/proxcgal"])
def test_a_folder_that_cannot_be_written_is_told_before_anything_is_simulated(
    call: Call, tmp_path: Path, place: str
) -> None:
    (tmp_path / "file").write_text("not a folder")
    answer = call("run", "front_plane", "--out", place)
    assert answer.code == 2
    assert answer.err.startswith(f"proxcgal: --out {place}: cannot be written")
    assert len(answer.err.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize("content", [b"", b"no recording", bytes(1000), b"\x89MCAP0\r\n"])
def test_what_is_no_recording_is_refused(call: Call, tmp_path: Path, content: bytes) -> None:
    (tmp_path / "wb.mcap").write_bytes(content)
    answer = call("replay", "wb.mcap")
    assert answer.code == 2
    assert "wb.mcap" in answer.err
    assert len(answer.err.splitlines()) == 1


# --- Runs


def test_a_run_writes_what_it_promises(results: Path) -> None:
    assert {path.name for path in results.iterdir()} == {
        "summary.json", "run.json", "scenario.toml", "distance.png", "pairs.png", "wb.mcap",
        "sm.mcap", "report.html",
    }  # fmt: skip
    summary = json.loads((results / "summary.json").read_text())
    assert summary["scenario"] == "front_plane"
    assert list(summary["controllers"]) == ["wb", "sm"]
    assert summary["failed"] is False


def test_a_run_ends_with_the_table_and_the_path_of_its_report(call: Call) -> None:
    answer = call("run", "front_plane", "--controller", "wb_known", "--no-picture", *QUICK)
    assert answer.code == 0
    assert answer.err == ""
    head, *_, last = answer.out.splitlines()
    assert head.split()[:2] == ["scenario", "controller"]
    assert "wb_known" in answer.out
    assert last == "out/front_plane/report.html"


def test_the_report_names_the_exact_command(results: Path) -> None:
    about = json.loads((results / "run.json").read_text())
    assert about["command"].startswith("proxcgal run front_plane --controller wb sm --out ")
    assert "proxcgal run front_plane --controller wb sm" in (results / "report.html").read_text()


def test_a_resolved_scenario_gives_the_same_numbers_again(call: Call, results: Path) -> None:
    answer = call(
        "run", results / "scenario.toml", "--controller", "sm", "wb", "--out", "again",
        "--workers", "2", "--no-picture", "--quiet",
    )  # fmt: skip
    assert answer.code == 0
    first, again = (
        json.loads((folder / "summary.json").read_text()) for folder in (results, Path("again"))
    )
    assert again == first


def test_a_log_gets_a_line_per_trial(call: Call) -> None:
    answer = call(
        "run", "front_plane", "--controller", "wb", "sm", "--set", "duration=0.2",
        "--no-picture", "--workers", "1",
    )  # fmt: skip
    told = [line for line in answer.err.splitlines() if "least true distance" in line]
    assert [line.split()[1] for line in told] == ["wb:", "sm:"]


def test_an_older_run_leaves_nothing_behind(call: Call) -> None:
    run = ("run", "front_plane", "--out", "here", "--no-picture", "--workers", "1", *QUICK)
    call(*run, "--controller", "wb", "sm")
    Path("here/notes.txt").write_text("mine")
    call(*run, "--controller", "wb")
    assert not Path("here/sm.mcap").exists()
    assert Path("here/notes.txt").read_text() == "mine"


def test_a_report_is_rebuilt_from_its_folder(call: Call, results: Path) -> None:
    before = (results / "report.html").read_bytes()
    (results / "report.html").unlink()
    answer = call("report", results)
    assert answer.out == f"{results}/report.html\n"
    assert (results / "report.html").read_bytes() == before


def test_ctrl_c_ends_with_130_and_keeps_what_was_recorded(tmp_path: Path) -> None:
    # A shell without job control starts background programs with Ctrl-C ignored: not here.
    program = subprocess.Popen(
        [*PROGRAM, "run", "front_plane", "--controller", "wb", "sm", "--out", "here", "--quiet",
         "--set", "duration=600", "--workers", "2"],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    recordings = [tmp_path / "here" / f"{name}.mcap" for name in ("wb", "sm")]
    patience = time.monotonic() + 300.0  # a busy machine without prepared meshes
    while not all(path.exists() and path.stat().st_size > 100_000 for path in recordings):
        assert program.poll() is None
        assert time.monotonic() < patience
        time.sleep(0.1)
    os.killpg(program.pid, signal.SIGINT)
    out, err = program.communicate(timeout=60)
    assert program.returncode == 130
    assert out == ""
    assert err == "proxcgal: interrupted; kept: here/sm.mcap, here/wb.mcap\n"
    for path in recordings:
        recording = read_recording(path)
        assert recording.damage is None
        assert len(recording.ticks) > 10
    assert {path.name for path in (tmp_path / "here").iterdir()} == {"wb.mcap", "sm.mcap"}


def test_the_demo_runs_both_scenes_and_ends_with_the_path_of_its_report(call: Call) -> None:
    answer = call("demo", "--out", "out", "--set", "duration=0.2", "--no-picture", "--quiet")
    assert answer.code == 0
    assert answer.out.splitlines()[-1] == "out/report.html"
    whole = json.loads(Path("out/summary.json").read_text())
    assert list(whole["scenarios"]) == ["front_plane", "side_plane"]
    for name, summary in whole["scenarios"].items():
        assert summary == json.loads(Path("out", name, "summary.json").read_text())
        assert list(summary["controllers"]) == ["wb", "sm", "wb_known"]
        for file in ("distance.png", "pairs.png", "wb.mcap", "sm.mcap", "wb_known.mcap"):
            assert Path("out", name, file).is_file()
    assert Path("out/report.html").read_text().count("<img ") == 4


def test_the_moving_picture_shows_both_controllers(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(motion_picture, "FRAMES", 3)
    monkeypatch.setattr(motion_picture, "HELD", 0)
    for name in ("wb.mcap", "sm.mcap"):
        shutil.copy(results / name, tmp_path)
    scenario = load_scenario("front_plane")
    told = draw_motion(scenario, tmp_path, lambda _: None)
    if "cannot draw off screen" in told:
        pytest.skip(told)
    with Image.open(tmp_path / "motion.gif") as picture:
        assert getattr(picture, "n_frames", 1) == 3
        assert picture.size == (
            2 * motion_picture.PANE[0],
            motion_picture.PANE[1] + motion_picture.STRIP,
        )
    assert {path.name for path in tmp_path.iterdir()} == {
        "wb.mcap", "sm.mcap", "motion.gif", "motion.png",
    }  # fmt: skip


def test_beside_a_person_the_still_shows_the_least_distance_of_all_runs(
    results: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recordings = [read_recording(results / name) for name in ("wb.mcap", "sm.mcap")]
    true = [[tick.truth.distance for tick in each.ticks] for each in recordings]
    run, row = np.unravel_index(int(np.argmin(true)), np.shape(true))
    setup = Setup.of(recordings[0].settings.scenario)
    end = recordings[0].ticks[-1].inputs.time
    assert motion_picture._time_shown(setup, recordings) == (end, -1)
    monkeypatch.setattr(motion_picture, "HriScenario", type(setup.scenario))
    assert motion_picture._time_shown(setup, recordings) == (
        recordings[run].ticks[row].inputs.time,
        run,
    )


def test_without_a_way_to_draw_a_run_keeps_its_numbers(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise px.SimulationError("cannot draw off screen")

    monkeypatch.setattr(motion_picture, "draw", refuse)
    shutil.copy(results / "wb.mcap", tmp_path)
    told = draw_motion(load_scenario("front_plane"), tmp_path, lambda _: None)
    assert told == "front_plane: no motion.gif: cannot draw off screen"
    assert [path.name for path in tmp_path.iterdir()] == ["wb.mcap"]


# --- Replay


def test_replay_prints_a_line_per_tick_and_the_numbers(call: Call, results: Path) -> None:
    answer = call("replay", results / "wb.mcap")
    assert answer.code == 0
    ticks = re.findall(r"^ +\d+\.\d\d  ", answer.out, re.MULTILINE)
    assert len(ticks) == 40
    summary = json.loads((results / "summary.json").read_text())
    assert f"{summary['controllers']['wb']['true_min_m']:.3f}" in answer.out


@pytest.mark.parametrize(
    ("options", "page"),
    [
        ({}, True), ({"no_view": True}, False), ({"at": 0.0}, False), ({"every": 1}, False),
        ({"step": True}, False), ({"controller": "sm"}, False), ({"set": (("seed=1",),)}, False),
        ({"controller": "sm", "view": True}, True),
    ],
)  # fmt: skip
def test_replay_opens_a_page_at_a_terminal_where_no_lines_are_asked_for(
    options: dict[str, Any], page: bool
) -> None:
    asked = ReplayOptions(file=Path("wb.mcap"), **options)
    assert opens_page(asked, terminal=True) == page
    assert opens_page(asked, terminal=False) == asked.view


def test_replay_thins_its_lines(call: Call, results: Path) -> None:
    answer = call("replay", results / "wb.mcap", "--every", "10")
    assert len(re.findall(r"^ +\d+\.\d\d  ", answer.out, re.MULTILINE)) == 4
    assert call("replay", results / "wb.mcap", "--every", "0").code == 2


def test_replay_shows_all_of_one_tick(call: Call, results: Path) -> None:
    answer = call("replay", results / "wb.mcap", "--at", "0.2")
    assert answer.code == 0
    tick = read_recording(results / "wb.mcap").ticks[20]
    assert " ".join(f"{value:.4f}" for value in tick.result.qd) in answer.out
    assert "avoidance activation" in answer.out
    answer = call("replay", results / "wb.mcap", "--at", "9")
    assert answer.code == 2
    assert "0 to 0.39 s" in answer.err


def test_replay_steps_with_enter_and_ends_with_q(
    call: Call, results: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = iter(["", "", "q"])
    monkeypatch.setattr("builtins.input", lambda _: next(answers))
    out = call("replay", results / "wb.mcap", "--step").out
    assert len(re.findall(r"^ +\d+\.\d\d  ", out, re.MULTILINE)) >= 1
    assert next(answers, None) is None


def test_replay_with_the_settings_it_was_made_with_is_the_same_bit_for_bit(
    call: Call, results: Path
) -> None:
    answer = call("replay", results / "wb.mcap", "--controller", "wb", "--every", "100")
    assert "the same as recorded, bit for bit" in answer.out


def test_replay_with_another_setting_tells_how_far_the_commands_differ(
    call: Call, results: Path
) -> None:
    answer = call(
        "replay", results / "wb.mcap", "--set", "controller.reach_gain=0.2", "--every", "100"
    )
    assert answer.code == 0
    assert re.search(r"differ from the recorded ones in \d+ of 40 ticks", answer.out)
    assert call("replay", results / "wb.mcap", "--set", "controller.nonsense=1").code == 2


def test_a_reader_that_stops_reading_ends_the_replay_quietly(results: Path) -> None:
    program = subprocess.Popen(
        [*PROGRAM, "replay", str(results / "wb.mcap")],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    assert program.stdout
    assert program.stderr
    program.stdout.readline()
    program.stdout.close()
    assert program.stderr.read() == b""
    program.stderr.close()
    assert program.wait(timeout=60) in (0, -signal.SIGPIPE)


def test_a_damaged_recording_is_read_up_to_the_damage(
    call: Call, results: Path, tmp_path: Path
) -> None:
    data = (results / "wb.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: len(data) // 2])
    answer = call("replay", "cut.mcap")
    assert answer.code == 0
    assert "damaged" in answer.err
    assert 1 < len(re.findall(r"^ +\d+\.\d\d  ", answer.out, re.MULTILINE)) < 40


def test_numbers_of_a_replay_are_those_of_the_run(results: Path) -> None:
    ticks = read_recording(results / "sm.mcap").ticks
    summary = json.loads((results / "summary.json").read_text())
    least = min(tick.truth.distance for tick in ticks)
    assert summary["controllers"]["sm"]["true_min_m"] == least
    assert np.isfinite(least)


def test_a_campaigns_folder_is_not_written_over(call: Call, tmp_path: Path) -> None:
    folder = tmp_path / "campaign"
    folder.mkdir()
    (folder / "campaign.json").write_text("{}")
    for command in (["sweep", "--quick"], ["run", "front_plane", *QUICK]):
        answer = call(*command, "--out", folder)
        assert answer.code == 2
        assert "holds a campaign" in answer.err
    assert [path.name for path in folder.iterdir()] == ["campaign.json"]


def test_a_full_disk_names_the_users_file_and_is_no_crash(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    path = tmp_path / "result.json"

    def work() -> int:
        write_json(path, {"a": 1})
        return 0

    assert main.guarded(work) == 2
    assert capsys.readouterr().err == f"proxcgal: {path}: No space left on device\n"
    assert not list(tmp_path.iterdir())

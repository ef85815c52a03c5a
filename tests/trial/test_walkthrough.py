"""Walk-throughs: taught by a simulated hand, watched, recorded, cleaned, played back."""

import csv
import errno
import io
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from scenario_keys import rows_of

from proxcgal.core.errors import ConfigError, RecordingError, SimulationError
from proxcgal.models.builtin import ga_ol
from proxcgal.scenario.loading import load_scenario, parse_scenario
from proxcgal.scenario.walkthrough_keys import LegKeys
from proxcgal.scenario.walkthrough_scenario import GuidedScenario, WalkScenario
from proxcgal.sim.physics import Physics
from proxcgal.study.plotting import GREY
from proxcgal.study.runs.walkthrough import read_ratings, walkthrough_lines
from proxcgal.study.walkthrough.figures import figures, trip_figure
from proxcgal.trial.trial import run_trial
from proxcgal.trial.walkthrough import playback
from proxcgal.trial.walkthrough.guided_source import off_path
from proxcgal.trial.walkthrough.intended_path import IntendedPath
from proxcgal.trial.walkthrough.log import WalkLog
from proxcgal.trial.walkthrough.playback import check_start, play
from proxcgal.trial.walkthrough.pose_recording import PoseRecorder, read_poses
from proxcgal.trial.walkthrough.run import WalkResult, run_walk
from proxcgal.trial.walkthrough.setup import PERIOD, WalkSetup
from proxcgal.trial.walkthrough.stopping_performance import (
    STRETCHED,
    worst_case_problem,
    worst_case_stops,
)
from proxcgal.trial.walkthrough.taught_path import (
    TaughtPath,
    clean_path,
    to_csv,
    to_trajectory,
    tool_positions,
)
from proxcgal.trial.walkthrough.teaching import REACHED, teach

ROOT = Path(__file__).parents[2]
DOCS, SCENARIOS = ROOT / "docs" / "walkthrough.md", ROOT / "docs" / "scenarios.md"
#: Tables of other kinds of scene.
OTHERS = ("| `goal.", "| `skin.", "| `limits.", "| `controller.", "| `simulation.", "| `obstacle.",
          "| `fault.", "| `perception`")  # fmt: skip
OWN = {
    "walkthrough_overspeed": "tcp_speed",
    "walkthrough_too_close": "distance",
    "walkthrough_closing_fast": "relative_velocity",
}
#: One sweep at the process's speed, and back a little.
SHORT = (
    "leg=[{to = [0.0, -0.75, 0.0], speed = 0.6, ramp = 0.9}, "
    "{to = [0.0, 0.75, 0.0], speed = 1.18, ramp = 0.9}]",
)


def setup_of(name: str, *changes: str) -> WalkSetup:
    scenario = load_scenario(name, changes)
    assert isinstance(scenario, WalkScenario)
    return WalkSetup.of(scenario)


@pytest.fixture(scope="module")
def short() -> WalkSetup:
    return setup_of("walkthrough_teach", *SHORT)


@pytest.fixture(scope="module")
def taught(short: WalkSetup) -> WalkLog:
    return teach(short, seed=0, with_truth=True)


@pytest.fixture(scope="module")
def path(short: WalkSetup, taught: WalkLog) -> TaughtPath:
    return clean_path(short.robot, taught.time, taught.q, step=0.004, tolerance=0.001)


@pytest.mark.parametrize("name", OWN)
def test_a_violation_trips_first_on_its_own_function_and_stops_in_time(name: str) -> None:
    setup = setup_of(name)
    log = teach(setup, seed=0, with_truth=True)
    assert [trip.function for trip in log.trips] == [OWN[name]]
    assert log.latency_cycles() in (0, 1)
    assert not log.false_trip()
    stop = log.stop_time_s()
    assert stop is not None
    assert stop <= setup.scenario.guard.stop_time
    after = log.torque[log.trips[0].cycle :]
    assert not after.any()  # torque never comes back by itself
    assert not log.overrun


def test_a_compliant_teaching_reaches_the_process_speed_without_a_trip(taught: WalkLog) -> None:
    assert taught.trips == []
    assert taught.max_tcp_speed() >= 1.1
    assert not taught.truly_violated().any()


def test_guard_agrees_with_the_simulators_own_kinematics(taught: WalkLog) -> None:
    np.testing.assert_allclose(taught.tcp_speed, taught.true_tcp_speed, atol=1e-12)
    np.testing.assert_allclose(taught.distance, taught.true_distance, atol=1e-12)
    np.testing.assert_allclose(taught.velocity, taught.true_velocity, atol=1e-12)
    ratio, true = taught.acceleration_ratio[2:], taught.true_acceleration_ratio[2:]
    np.testing.assert_allclose(ratio, true, atol=1e-8)


def test_the_same_seed_teaches_the_same_bit_for_bit(short: WalkSetup, taught: WalkLog) -> None:
    assert teach(short, seed=0).q.tobytes() == taught.q.tobytes()


def test_playback_follows_within_2_mm_rms(short: WalkSetup, path: TaughtPath) -> None:
    played = play(short, path)
    assert played.log.trips == []
    assert np.sqrt((played.error_m**2).mean()) <= 0.002


def test_a_slower_playback_takes_as_much_longer(short: WalkSetup, path: TaughtPath) -> None:
    slow = setup_of("walkthrough_teach", *SHORT, "playback.scale=2.0")
    assert play(slow, path).time_s == pytest.approx(2 * path.duration)


def test_a_playback_too_fast_for_the_guard_is_slowed_down(
    short: WalkSetup, path: TaughtPath
) -> None:
    hurried = setup_of("walkthrough_teach", *SHORT, "playback.scale=0.2")
    played = play(hurried, path)
    assert played.scale > 0.5
    assert played.log.trips == []


def test_playback_refuses_to_begin_elsewhere(short: WalkSetup, path: TaughtPath) -> None:
    q = path.q[0] + [0.01, 0.0, 0.0, 0.0, 0.0, 0.0]
    with pytest.raises(ConfigError, match=r"mm from the path's start; playback.start_tolerance"):
        check_start(short.robot, q, path, 0.005)
    check_start(short.robot, path.q[0], path, 0.005)


def test_a_playback_that_trips_on_its_way_to_the_start_tells_what_tripped(
    path: TaughtPath, monkeypatch: pytest.MonkeyPatch
) -> None:
    short = setup_of("walkthrough_teach", *SHORT, "playback.approach_speed=10.0")
    monkeypatch.setattr(playback, "_APPROACH_SHARE", 4.0)
    q = path.q[0] + np.array([0.0, 0.0, 0.0, 1.5, 0.0, 0.0])
    played = play(short, path, q)
    assert played.log.trips[0].function in {"joint_speed", "joint_acceleration"}
    assert not played.log.torque[-1]
    told = walkthrough_lines(WalkResult(teach(short, seed=0), path, played).summary())
    assert any("played back up to" in line and "joint_" in line for line in told)


@pytest.mark.parametrize("tolerance", [0.0005, 0.002])
def test_cleaning_moves_the_tool_by_no_more_than_its_tolerance(
    short: WalkSetup, taught: WalkLog, tolerance: float
) -> None:
    found = clean_path(short.robot, taught.time, taught.q, step=0.004, tolerance=tolerance)
    moved = tool_positions(short.robot, found.at(found.raw_time)[0]) - found.raw_tool_W
    assert np.linalg.norm(moved, axis=1).max() == pytest.approx(found.deviation_m)
    assert found.deviation_m <= tolerance
    assert found.window_s > 0.0


def test_a_cleaned_path_gives_its_samples_and_the_derivative_between(path: TaughtPath) -> None:
    np.testing.assert_allclose(path.at(path.time)[0], path.q, atol=1e-12)
    times = np.linspace(0.1, path.duration - 0.1, 50)
    slope = (path.at(times + 1e-6)[0] - path.at(times - 1e-6)[0]) / 2e-6
    np.testing.assert_allclose(path.at(times)[1], slope, atol=1e-5)


def test_exports_hold_the_path(short: WalkSetup, path: TaughtPath) -> None:
    rows = list(csv.DictReader(io.StringIO(to_csv(short.robot, path))))
    assert len(rows) == len(path.time)
    row = rows[len(rows) // 2]
    q = np.array([float(row[f"{name}_rad"]) for name in short.robot.joint_names])
    T = np.array(short.robot.tool_pose(q))
    np.testing.assert_allclose([float(row[f"{a}_m"]) for a in "xyz"], T[:3, 3], atol=1e-6)
    x, y, z, w = (float(row[f"q{a}"]) for a in "xyzw")
    third = [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)]
    np.testing.assert_allclose(third, T[:3, 2], atol=1e-6)
    trajectory = json.loads(json.dumps(to_trajectory(short.robot, path)))
    assert trajectory["joint_names"] == list(short.robot.joint_names)
    np.testing.assert_allclose([p["positions_rad"] for p in trajectory["points"]], path.q)


_TEACH = """
import os, signal, sys
from proxcgal.scenario.loading import load_scenario
from proxcgal.trial.walkthrough.pose_recording import PoseRecorder
from proxcgal.trial.walkthrough.setup import WalkSetup
from proxcgal.trial.walkthrough.teaching import teach
setup = WalkSetup.of(load_scenario("walkthrough_teach"))
class Killed(PoseRecorder):
    def write(self, *pose):
        super().write(*pose)
        if self._count == 300:
            os.kill(os.getpid(), signal.SIGKILL)
with Killed(sys.argv[1], {"seed": "0"}) as recorder:
    teach(setup, seed=0, recorder=recorder)
"""


def test_every_pose_written_before_a_kill_can_be_read(tmp_path: Path) -> None:
    file = tmp_path / "taught.mcap"
    done = subprocess.run([sys.executable, "-c", _TEACH, str(file)], check=False)
    assert done.returncode == -signal.SIGKILL
    poses = read_poses(file)
    assert poses.damage is not None
    assert len(poses.time) == 300
    np.testing.assert_allclose(np.diff(poses.time), PERIOD, atol=1e-12)


def test_part_of_a_path_is_not_played_where_the_disk_was_full(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    setup = setup_of("walkthrough_teach", *SHORT)
    write = PoseRecorder.write

    def until_full(recorder: PoseRecorder, time: float, *pose: Any) -> None:
        if time < 2.0:
            write(recorder, time, *pose)
        elif recorder.failure is None:
            with recorder.guarded():
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(PoseRecorder, "write", until_full)
    with (
        pytest.warns(RuntimeWarning, match="No space left"),
        pytest.raises(RecordingError, match=r"No space left.*not the whole path"),
    ):
        run_walk(setup, seed=0, recording=tmp_path / "taught.mcap")


def test_a_file_that_holds_no_teaching_is_refused(tmp_path: Path) -> None:
    (tmp_path / "other.mcap").write_bytes(b"\x89MCAP0\r\n")
    with pytest.raises(RecordingError, match="holds no poses"):
        read_poses(tmp_path / "other.mcap")


def test_wished_legs_go_from_rest_to_rest_and_no_faster_than_said() -> None:
    legs = (
        LegKeys(to=(0.0, 1.0, 0.0), speed=0.8, ramp=0.4),
        LegKeys(to=(0.0, 1.0, 0.0), turn=(0.0, 0.5, 0.0), speed=0.8, turn_speed=0.3),
    )
    wish = IntendedPath.of(legs, PERIOD)
    assert np.linalg.norm(wish.velocity, axis=1).max() == pytest.approx(0.8)
    assert np.linalg.norm(wish.spin, axis=1).max() == pytest.approx(0.3)
    np.testing.assert_allclose(wish.position[-1], (0.0, 1.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(wish.turn[-1], (0.0, 0.5, 0.0), atol=1e-12)
    np.testing.assert_allclose(
        np.diff(wish.position, axis=0)[:-1] / PERIOD, wish.velocity[1:-1], atol=5e-3
    )


def test_brakes_hold_twice_what_the_stretched_arm_weighs() -> None:
    arm = ga_ol()
    physics = Physics(arm, np.array(STRETCHED), payload=5.0)
    static = np.abs(physics._data.qfrc_bias)
    brakes = np.array([link.brake for link in arm.moving])
    assert (brakes >= 1.99 * static).all()


def test_an_arm_without_torque_falls_until_its_brakes_close_and_then_holds() -> None:
    physics = Physics(ga_ol(), np.array(STRETCHED))
    for _ in range(500):
        physics.step(np.zeros(6), True)
    height = float(physics.tool_W[2])
    speed = []
    for _ in range(1000):
        physics.step(np.zeros(6), False)
        speed.append(float(np.abs(physics.qd).max()))
    assert max(speed[:50]) > 0.05  # 30 ms pass before brakes begin to close
    assert speed[-1] < 1e-3
    assert 0.0 < height - physics.tool_W[2] < 0.10


def test_weaker_brakes_stop_later(short: WalkSetup) -> None:
    times = [stop.stop_time_s for stop in worst_case_stops(short)]
    assert times == sorted(times, reverse=True)
    assert times[1] <= 0.35


def test_stops_tell_the_brakes_that_they_were_made_with() -> None:
    setup = setup_of("walkthrough_overspeed", "arm.brake_scale=0.8")
    brakes = [stop.brake_scale for stop in worst_case_stops(setup)]
    assert brakes == pytest.approx([0.56, 0.8, 1.04])


def test_an_arm_that_is_not_stretched_level_in_that_posture_is_not_looked_at_in_it(
    tmp_path: Path,
) -> None:
    text = Path(str(files("proxcgal.models") / "ga_ol.toml")).read_text()
    other = tmp_path / "other.toml"
    for change, told in (
        (("range = [-1.05, 1.92]", "range = [-1.05, 1.5]"), "beyond the limits of joint_2"),
        (("axis = [0.0, 1.0, 0.0]", "axis = [0.0, 0.0, 1.0]"), "joint_2 does not bring the tool"),
    ):
        other.write_text(text.replace(*change, 1).replace('"ga_ol"', '"other"'))
        setup = setup_of("walkthrough_overspeed", f"robot={other}")
        assert worst_case_stops(setup) == []
        assert told in (worst_case_problem(setup) or "")
    assert worst_case_problem(setup_of("walkthrough_overspeed")) is None


def test_nobody_pulls_in_a_cycle_that_is_told_no_force() -> None:
    arms = [Physics(ga_ol(), np.array(STRETCHED)) for _ in range(2)]
    for arm, force in zip(arms, (None, np.zeros(6)), strict=True):
        arm.step(np.zeros(6), True, np.array([0.0, 200.0, 0.0, 0.0, 0.0, 0.0]))
        for _ in range(5):
            arm.step(np.zeros(6), True, force)
    np.testing.assert_array_equal(arms[0].qd, arms[1].qd)


def test_an_arm_is_told_of_its_own_warnings_where_another_was_made_after_it() -> None:
    first, second = (Physics(ga_ol(), np.array(STRETCHED)) for _ in range(2))
    first.q[:] = np.nan
    with pytest.raises(SimulationError, match="MuJoCo warned"):
        first.step(np.zeros(6), True)
    second.step(np.zeros(6), True)


def test_the_preset_of_the_hand_guiding_rules_takes_longer(short: WalkSetup) -> None:
    slow = teach(setup_of("walkthrough_teach", *SHORT).slow(), seed=0)
    assert slow.trips == []
    assert slow.max_tcp_speed() <= 0.25
    assert slow.cycles > 1.5 * teach(short, seed=0).cycles


def test_a_contradiction_is_refused_unless_the_file_accepts_it() -> None:
    with pytest.raises(ConfigError) as caught:
        setup_of("walkthrough_teach", "guard.accept=[]", "guard.min_distance=0.4")
    lines = str(caught.value).splitlines()
    for item in ("stopping_distance", "closing_distance", "joint_stop.joint_4"):
        assert any(f'accept = ["{item}"]' in line for line in lines), item
    assert all(line.startswith("scenario walkthrough_teach: guard: ") for line in lines)


def test_a_pair_that_is_always_violated_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"tool is at most .* m from the operator's capsule"):
        setup_of("walkthrough_teach", 'guard.pairs=["link_2", "tool"]')


def test_what_is_monitored_accepted_and_missing_is_told(short: WalkSetup) -> None:
    told = "\n".join(short.notes())
    assert "distance to the operator: link_1, link_2, link_3, link_4" in told
    assert "accepted joint_stop.joint_6" in told
    assert "ISO/TS 15066 would be 0.98 m" in told


def test_a_scenario_survives_being_written_and_read(short: WalkSetup) -> None:
    text = short.scenario.to_toml()
    assert parse_scenario(text, "text") == short.scenario


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ("robot=ur10e", "with weight and brakes: 'ga_ol'"),
        ("q0=[0, 0]", "joint_1, joint_2"),
        ("skin.rings=[]", "a walk-through has no such table"),
        ("hand.stiffness=-1.0", "hand.stiffness"),
        ("guard.pairs=['link_9']", "must be one of link_1, link_2"),
        ("guard.q_reference=[0, 9, 0, 0, 0, 0]", "must be within the joints' ranges"),
    ],
)
def test_bad_input_is_told_in_one_line(change: str, told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        setup_of("walkthrough_teach", change)


def test_every_key_is_documented_with_its_default() -> None:
    text = DOCS.read_text()
    missing = [row for row in rows_of(WalkScenario) if row not in text and "`kind`" not in row]
    static = SCENARIOS.read_text()
    assert [row for row in missing if row not in static and not row.startswith(OTHERS)] == []


def test_ratings_of_a_users_own_are_read_and_what_is_wrong_is_told(tmp_path: Path) -> None:
    table = tmp_path / "ratings.csv"
    table.write_text("safety,stress\n9,1\n8,\n10,2.5\n")
    assert read_ratings(table) == {"safety": [9.0, 8.0, 10.0], "stress": [1.0, 2.5]}
    table.write_text("safety,stress\n9,1\n", encoding="utf-8-sig")  # as spreadsheets write it
    assert read_ratings(table) == {"safety": [9.0], "stress": [1.0]}
    table.write_text("safety,stress\n11,x\n")
    with pytest.raises(ConfigError) as caught:
        read_ratings(table)
    assert len(str(caught.value).splitlines()) == 2
    assert "line 2, safety = '11': a number from 0 to 10" in str(caught.value)


def test_the_arm_keeps_away_from_a_bystander_while_the_tool_follows_the_hand() -> None:
    short = ("duration=5.0", "perception=known")
    guided = load_scenario("walkthrough_bystander", short)
    assert isinstance(guided, GuidedScenario)
    alone = ('controller.tasks=["reach_position", "reach_orientation"]',)
    logs = [
        run_trial(scenario, "wb_known", sparse_truth=True)
        for scenario in (guided, load_scenario("walkthrough_bystander", (*short, *alone)))
    ]
    kept, heedless = (log.summary()["true_min_m"] for log in logs)
    assert kept > heedless + 0.03
    assert kept >= guided.controller.d_min
    assert off_path(guided, logs[0]).max() < 0.05


def test_an_operator_who_rides_on_the_tool_has_the_tools_velocity() -> None:
    name, change = "walkthrough_closing_fast", "guard.subtract_human=true"
    log = teach(setup_of(name, change), seed=0)
    assert "relative_velocity" not in [trip.function for trip in log.trips]


def test_a_run_writes_what_the_experiment_asks_for(call: Callable[..., Any]) -> None:
    answer = call("run", "walkthrough_overspeed", "--quiet")
    assert answer.code == 0, answer.err
    folder = Path("out/walkthrough_overspeed")
    summary = json.loads((folder / "summary.json").read_text())
    keys = {"scenario", "trips", "stop_time_s", "stop_distance_m", "playback_error_m",
            "max_tcp_speed_mps"}  # fmt: skip
    assert keys <= summary.keys()
    assert summary["trips"][0].keys() >= {"time_s", "function", "value", "limit"}
    assert summary["peak_after_cut_mps"] >= summary["trips"][0]["value"]
    assert {s["brake_scale"] for s in summary["stops"]} == {0.7, 1.0, 1.3}
    files = {path.name for path in folder.iterdir()}
    assert files >= {"walkthrough.png", "taught.mcap", "scenario.toml", "run.json", "report.html"}
    assert "tcp_speed" in (folder / "report.html").read_text()


def test_a_run_refuses_what_a_walkthrough_has_no_use_or_no_time_for(
    call: Callable[..., Any],
) -> None:
    for options, told in (
        (("--controller", "wb"), "--controller wb: walkthrough_teach has kind"),
        (("--set", "duration=3"), "duration = 3 s: the wished path takes"),
        (("--set", "duration=20"), "to teach by the hand-guiding rules"),
    ):
        answer = call("run", "walkthrough_teach", *options, "--quiet")
        assert answer.code == 2
        assert told in answer.err
    assert not Path("out").exists()


def test_what_is_refused_leaves_the_files_of_an_older_run(call: Callable[..., Any]) -> None:
    older = Path("out/walkthrough_teach/taught.mcap")
    older.parent.mkdir(parents=True)
    older.write_bytes(b"older")
    assert call("run", "walkthrough_teach", "--set", "duration=3", "--quiet").code == 2
    assert older.read_bytes() == b"older"


def test_an_arm_of_ones_own_runs_or_is_refused_before_anything_is_written(
    call: Callable[..., Any], tmp_path: Path
) -> None:
    text = Path(str(files("proxcgal.models") / "ga_ol.toml")).read_text()
    bare, five = tmp_path / "bare.toml", tmp_path / "five.toml"
    bare.write_text(re.sub(r"(?m)^brake = .*$", "", text))
    five.write_text(text.replace('joint = "joint_6"\n', ""))
    answer = call("run", "walkthrough_overspeed", "--robot", str(bare), "--quiet")
    assert answer.code == 2
    assert "physics needs mass and brake of joint_1 (brake)" in answer.err
    assert not Path("out").exists()
    setup = setup_of(
        "walkthrough_overspeed", f"robot={five}", "q0=[0.0, 0.26, 0.52, 0.0, -0.785]",
        "guard.q_reference=[0.0, -0.35, 1.22, 0.0, -0.87]", "guard.accept=['joint_stop.joint_4']",
    )  # fmt: skip
    assert worst_case_stops(setup) == []


def test_a_hand_too_weak_for_its_path_is_told(taught: WalkLog) -> None:
    assert taught.left_m is not None
    assert taught.left_m <= REACHED
    weak = teach(setup_of("walkthrough_teach", *SHORT, "hand.max_force=5.0"), seed=0)
    assert weak.left_m is not None
    assert weak.left_m > REACHED
    summary = WalkResult(weak).summary()
    assert f"let go {weak.left_m:.3f} m from the path's end" in walkthrough_lines(summary)[-1]


def test_the_figure_of_a_trip_shows_the_quantity_that_tripped() -> None:
    farther = "guard.q_reference=[0.0, 0.26, 0.52, 0.0, -0.785, 0.0]"  # tighter bounds on joints
    log = teach(setup_of("walkthrough_overspeed", farther), seed=0)
    assert [trip.function for trip in log.trips] == ["joint_speed"]
    figure = trip_figure(log, title="")
    assert figure.axes[0].get_ylabel() == "joint speed, of its bound [-]"


def test_a_campaign_draws_the_same_operators_again_and_finds_no_false_trip(
    call: Callable[..., Any],
) -> None:
    answer = call("campaign", "walkthrough", "--runs", "2", "--workers", "1", "--quiet")
    assert answer.code == 0, answer.err
    summary = json.loads(Path("out/campaign-walkthrough/summary.json").read_text())
    assert summary["false_trips"] == summary["missed"] == summary["overruns"] == 0
    assert {name: found["own_function"] for name, found in summary["wishes"].items()} == {
        "compliant": 1, "overspeed": 1,
    }  # fmt: skip
    assert summary["stop_time_s"]["max"] <= 0.35


def test_a_stop_over_its_bound_is_inside_the_campaigns_figure() -> None:
    table = pl.DataFrame(
        {"error": [None], "tripped": ["tcp_speed"], "wish": ["overspeed"], "stop_time_s": [0.6],
         "stop_distance_m": [0.7], "stop_time_bound_s": [0.5], "min_distance_m": [0.3]},
        schema_overrides={"error": pl.String},
    )  # fmt: skip
    axes = figures(table)["stops.png"].axes
    assert axes[0].get_xlim()[1] > 0.6
    assert axes[1].get_xlim()[1] > 0.7
    bounds = [line.get_xdata()[0] for ax in axes for line in ax.lines if line.get_color() == GREY]
    assert bounds == [0.5, 0.3]  # those of the runs

"""One run: the same seed gives the same bits, faults act, replays repeat, the arm backs away."""

import errno
import functools
import itertools
import os
import statistics
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mcap.writer import Writer
from PIL import Image

import proxcgal as px
from proxcgal.evaluation.trial_log import TrialLog, final_ticks
from proxcgal.recording.reader import Recording, read_recording
from proxcgal.recording.render import draw, recorded_moments, write_gif
from proxcgal.recording.replay import Replay, first_difference, recompute, recorded_log
from proxcgal.recording.writer import Recorder
from proxcgal.scenario.fault_keys import INPUT_FAULTS, Fault
from proxcgal.scenario.loading import load_scenario
from proxcgal.scenario.setup import Setup, make_robot
from proxcgal.sim.faults import FaultInjector
from proxcgal.sim.range_sensor import NO_TARGET, VALID
from proxcgal.sim.tick import TickInput
from proxcgal.sim.world import World
from proxcgal.study.motion_picture import _draw
from proxcgal.study.trial_simulation import simulate_trial, warn_of_stopped
from proxcgal.trial.trial import run_trial

SHORT = ["duration=1.0"]
NAMES = [f"s{row}" for row in range(4)]


@pytest.fixture(scope="module")
def ur10e() -> px.Robot:
    return px.load_robot("ur10e")


@dataclass
class Runs:
    """Whole runs, each made once."""

    folder: Path
    robot: px.Robot
    logs: dict[tuple[str, str, int], TrialLog] = field(default_factory=dict)

    def __call__(self, scenario: str, controller: str, seed: int = 0) -> TrialLog:
        key = (scenario, controller, seed)
        if key not in self.logs:
            loaded = load_scenario(scenario)
            self.logs[key] = run_trial(loaded, controller, seed=seed, robot=self.robot)
        return self.logs[key]


@pytest.fixture(scope="module")
def runs(ur10e: px.Robot, tmp_path_factory: pytest.TempPathFactory) -> Runs:
    return Runs(tmp_path_factory.mktemp("runs"), ur10e)


@pytest.fixture(scope="module")
def recording(ur10e: px.Robot, tmp_path_factory: pytest.TempPathFactory) -> Recording:
    path = tmp_path_factory.mktemp("recording") / "wb.mcap"
    scenario = load_scenario("front_plane", ["duration=3.0"])
    with Recorder(path) as recorder:
        run_trial(scenario, "wb", seed=2, robot=ur10e, recorder=recorder)
    return read_recording(path)


def same(a: TrialLog, b: TrialLog) -> bool:
    names = ("time", "q", "qd", "seen_m", "true_m", "activation", "pair_obstacle_W", "goal_error_m")
    return all(getattr(a, name).tobytes() == getattr(b, name).tobytes() for name in names)


@pytest.mark.parametrize("controller", ["wb", "sm", "wb_known"])
def test_a_seed_gives_the_same_run_bit_for_bit(ur10e: px.Robot, controller: str) -> None:
    scenario = load_scenario("front_plane", SHORT)
    first, second = (run_trial(scenario, controller, seed=4, robot=ur10e) for _ in range(2))
    assert same(first, second)


def test_another_seed_gives_another_run(ur10e: px.Robot) -> None:
    scenario = load_scenario("front_plane", SHORT)
    first, second = (run_trial(scenario, "wb", seed=seed, robot=ur10e) for seed in (0, 1))
    assert not same(first, second)


def test_a_log_has_one_row_a_tick_and_the_arm_follows_its_commands(runs: Runs) -> None:
    log = runs("front_plane", "wb")
    n = 1200
    assert len(log.time) == n
    for name in ("q", "qd", "seen_m", "true_m", "self_m", "activation", "mode", "tick_us"):
        assert len(getattr(log, name)) == n
    assert len(log.control_link) == n
    np.testing.assert_allclose(np.diff(log.time), 0.01)
    np.testing.assert_allclose(np.diff(log.q, axis=0), 0.01 * log.qd[:-1], atol=1e-15)


def test_summary_is_what_the_arrays_say(runs: Runs) -> None:
    log = runs("front_plane", "wb")
    summary = log.summary()
    assert summary["true_min_m"] == log.true_m.min()
    assert summary["true_final_m"] == pytest.approx(log.true_m[-200:].mean(), abs=1e-3)
    assert summary["seen_min_m"] == log.seen_m.min()
    assert summary["goal_error_m"] == log.goal_error_m[-1]
    assert summary["violations"] == (log.true_m < 0.05).sum()
    assert summary["self_min_m"] == log.self_m.min()


def test_sparse_truth_gives_the_same_summary(ur10e: px.Robot) -> None:
    scenario = load_scenario("front_plane", ["duration=3.0", "obstacle.0.position.0=0.45"])
    every, sparse = (
        run_trial(scenario, "sm", robot=ur10e, sparse_truth=sparse) for sparse in (False, True)
    )
    assert np.isnan(sparse.true_m).any()
    assert sparse.q.tobytes() == every.q.tobytes()
    told = sparse.summary()
    assert told["violations"] > 0
    for key, value in every.summary().items():
        assert key == "wall_s" or told[key] == value


def test_distance_to_nothing_is_reported_as_9_99(ur10e: px.Robot) -> None:
    scenario = load_scenario("front_plane", ["duration=0.2", "obstacle=[]"])
    summary = run_trial(scenario, "wb_known", robot=ur10e).summary()
    assert summary["true_min_m"] == summary["true_final_m"] == summary["seen_min_m"] == 9.99
    assert summary["violations"] == 0


def test_no_self_hit_survives_the_filter(runs: Runs) -> None:
    """The arm must not flee from itself ([WA] Algorithm 1 alone lets 4 to 7 points through)."""
    log = runs("front_plane", "wb")
    assert log.cloud_points.max() > 100
    assert log.leaked_points.max() == 0


def test_known_perception_gives_every_controller_the_scene_itself(ur10e: px.Robot) -> None:
    scenario = load_scenario("front_plane", ["duration=0.2", "perception=known"])
    log = run_trial(scenario, "wb", robot=ur10e)
    np.testing.assert_allclose(log.seen_m, log.true_m, atol=0.003)


def test_known_points_cover_the_scenes_surfaces(ur10e: px.Robot) -> None:
    points = Setup.of(load_scenario("front_plane"), ur10e).known_cloud(0.05)(0.0)
    assert points[:, 0].min() == pytest.approx(0.817)
    assert points[:, 0].max() == pytest.approx(0.837)
    assert len(points) > 2 * 400


def test_progress_rises_to_one(ur10e: px.Robot) -> None:
    shares: list[float] = []
    run_trial(load_scenario("front_plane", SHORT), "wb", robot=ur10e, on_progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert len(shares) >= 10


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["q0=[0, 0]"], r"q0 has 2 values: ur10e has 6 joints"),
        (["q0=[0, 0, 9, 0, 0, 0]"], r"q0\.2 = 9: elbow_joint of ur10e goes from -3\.14"),
        (["skin.rings.0.link=arm"], r"skin\.rings\.0\.link = 'arm': ur10e has the links"),
        (["fault=[{kind='nan', sensor=99}]"], r"fault\.0\.sensor = 99: unknown; a row from 0 to"),
        (["fault=[{kind='nan', sensor='x'}]"], r"fault\.0\.sensor = 'x': unknown"),
    ],
)
def test_what_does_not_fit_the_robot_is_told(
    ur10e: px.Robot, overrides: list[str], message: str
) -> None:
    with pytest.raises(px.ConfigError, match=message):
        run_trial(load_scenario("front_plane", overrides), "wb", robot=ur10e)


def test_an_unknown_controller_lists_those_there_are(ur10e: px.Robot) -> None:
    with pytest.raises(px.ConfigError, match="wb, sm, wb_known"):
        run_trial(load_scenario("front_plane"), "vb", robot=ur10e)


def test_nothing_is_recorded_of_a_run_that_cannot_start(ur10e: px.Robot, tmp_path: Path) -> None:
    scenario = load_scenario("front_plane", ["q0=[0, 0]"])
    with Recorder(tmp_path / "a.mcap") as recorder, pytest.raises(px.ConfigError):
        run_trial(scenario, "wb", robot=ur10e, recorder=recorder)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_changes_no_command_and_is_told(ur10e: px.Robot) -> None:
    scenario = load_scenario("front_plane", ["duration=0.3"])
    with Recorder("/dev/full") as recorder, pytest.warns(RuntimeWarning, match="No space left"):
        log = run_trial(scenario, "wb", robot=ur10e, recorder=recorder)
    assert log.recording_failure is not None
    assert same(log, run_trial(scenario, "wb", robot=ur10e))


def test_a_recording_that_could_not_be_closed_is_told_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: Writer) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Writer, "finish", full)
    scenario = load_scenario("front_plane", ["duration=0.05"])
    told = functools.partial(simulate_trial, scenario, "wb", 0, lambda _: None)
    assert "No space left" in (told(recording=tmp_path / "a.mcap").recording_failure or "")
    trial = SimpleNamespace(scenario=scenario, controller="wb", seed=0)
    assert "No space left" in _draw([trial], tmp_path, lambda _: None)  # type: ignore[list-item]
    log = told(recording=tmp_path / "a.mcap")
    with pytest.warns(RuntimeWarning, match="No space left"):
        warn_of_stopped([log])


def test_what_held_an_arm_is_asked_where_it_really_is() -> None:
    fault = 'fault=[{kind = "joints_nan", from = 0.02}, {kind = "clock_jump", value = 5.0}]'
    short = ["duration=0.04", "simulation.known_spacing=0.1", 'initial=["free"]']
    (start,) = load_scenario("joint_free", short).starts()  # type: ignore[attr-defined]
    (faulty,) = load_scenario("joint_free", [*short, fault]).starts()  # type: ignore[attr-defined]
    plain, log = (run_trial(s, "wb_known", without_truth=True) for s in (start, faulty))
    assert plain.ending is not None
    assert log.ending is not None
    assert "nan" not in log.ending.reason
    assert "m and" in log.ending.reason


def test_recording_does_not_change_the_run(ur10e: px.Robot, recording: Recording) -> None:
    scenario = load_scenario("front_plane", ["duration=3.0"])
    assert same(recorded_log(recording), run_trial(scenario, "wb", seed=2, robot=ur10e))


def test_a_replay_gives_every_recorded_answer_again_bit_for_bit(recording: Recording) -> None:
    assert len(recording.ticks) == 300
    assert first_difference(recording) is None
    assert same(recompute(recording), recorded_log(recording))


def test_a_replay_of_known_points_is_bit_identical_too(ur10e: px.Robot, tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap") as recorder:
        scenario = load_scenario("side_plane", ["duration=0.5"])
        run_trial(scenario, "wb_known", robot=ur10e, recorder=recorder)
    assert first_difference(read_recording(tmp_path / "a.mcap")) is None


def test_a_changed_setting_changes_the_replayed_commands_and_nothing_else(
    recording: Recording,
) -> None:
    then = recorded_log(recording)
    now = recompute(recording, overrides=["controller.d_min=0.5"])
    assert now.q.tobytes() == then.q.tobytes()
    assert now.true_m.tobytes() == then.true_m.tobytes()
    assert now.qd.tobytes() != then.qd.tobytes()
    assert (now.activation >= then.activation).all()


def test_another_controller_can_be_given_the_recorded_inputs(recording: Recording) -> None:
    sm = recompute(recording, "sm")
    assert sm.controller == "sm"
    assert set(sm.control_link) <= {"forearm_link", ""}


def test_scans_cannot_be_made_up_for_a_replay(ur10e: px.Robot, tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap") as recorder:
        scenario = load_scenario("front_plane", ["duration=0.1"])
        run_trial(scenario, "wb_known", robot=ur10e, recorder=recorder)
    with pytest.raises(px.ConfigError, match="holds no scans"):
        Replay(read_recording(tmp_path / "a.mcap"), "wb")


def made_scans(stamp: float, counter: int) -> list[px.Scan]:
    ranges = np.full(64, 0.5 + 0.001 * counter)
    status = np.full(64, VALID, np.uint8)
    ranges[0], status[0] = 0.0, NO_TARGET
    return [px.Scan(row, counter, stamp, ranges, status) for row in range(4)]


def through(fault: Fault, until: int = 12) -> Iterator[tuple[int, dict[int, px.Scan]]]:
    """Scans 0, 1, 2, ... every 0.1 s through one fault, by sensor; the fault is from 0.3 to 0.6."""
    injector = FaultInjector([fault], NAMES, seed=1)
    for counter in range(until):
        yield counter, {scan.sensor: scan for scan in injector(made_input(counter)).scans}


def made_input(counter: int) -> TickInput:
    time = 0.1 * counter
    return TickInput(time, np.zeros(6), np.eye(4), tuple(made_scans(time, counter)))


def injected(kind: str, **more: object) -> Fault:
    of = {} if kind in INPUT_FAULTS else {"sensor": 2}
    content = {"kind": kind, **of, "from": 0.25, "to": 0.55, **more}
    return Fault.model_validate(content)


@pytest.mark.parametrize(
    "kind", ["silent", "frozen", "stuck_payload", "nan", "zero", "dropout", "offset", "delay"]
)
def test_a_fault_leaves_other_sensors_and_other_times_alone(kind: str) -> None:
    for counter, scans in through(injected(kind)):
        expected = made_scans(0.1 * counter, counter)
        for row in (0, 1, 3) if 3 <= counter <= 6 else (0, 1, 2, 3):
            assert scans[row].counter == counter
            assert scans[row].ranges.tobytes() == expected[row].ranges.tobytes()


def faulty(fault: Fault) -> dict[int, px.Scan | None]:
    return {counter: scans.get(2) for counter, scans in through(fault) if 3 <= counter <= 5}


def test_a_silent_sensor_sends_nothing() -> None:
    assert faulty(injected("silent")) == {3: None, 4: None, 5: None}


def test_a_frozen_sensor_repeats_its_last_scan_with_its_counter() -> None:
    for counter, scan in faulty(injected("frozen")).items():
        assert scan is not None
        assert scan.counter == 2
        assert scan.stamp == pytest.approx(0.1 * counter)
        np.testing.assert_array_equal(scan.ranges[1:], 0.502)


def test_a_stuck_payload_comes_with_advancing_counters() -> None:
    for counter, scan in faulty(injected("stuck_payload")).items():
        assert scan is not None
        assert scan.counter == counter
        np.testing.assert_array_equal(scan.ranges[1:], 0.502)


@pytest.mark.parametrize(
    ("kind", "value"), [("nan", np.nan), ("infinite", np.inf), ("negative", -0.1), ("zero", 0.0)]
)
def test_bad_ranges_come_with_a_valid_status(kind: str, value: float) -> None:
    for scan in faulty(injected(kind)).values():
        assert scan is not None
        np.testing.assert_array_equal(scan.ranges, value)
        assert (scan.status == VALID).all()


def test_a_wrong_stamp_and_a_status_code_come_as_they_were_asked_for() -> None:
    for counter, scan in faulty(injected("stamp_offset", value=-0.04)).items():
        assert scan is not None
        assert scan.stamp == pytest.approx(0.1 * counter - 0.04)
    for scan in faulty(injected("status", value=13)).values():
        assert scan is not None
        assert (scan.status == 13).all()


def test_a_duplicate_is_the_same_scan_twice() -> None:
    out = FaultInjector([injected("duplicate")], NAMES, seed=1)(made_input(3))
    assert [scan.counter for scan in out.scans if scan.sensor == 2] == [3, 3]


def test_faults_of_other_inputs_go_by_the_time_of_the_tick() -> None:
    at = {
        kind: FaultInjector([injected(kind)], NAMES, seed=1)
        for kind in ("joints_old", "clock_jump", "late")
    }
    assert at["joints_old"](made_input(3)).q_stamp == pytest.approx(0.25)
    assert at["joints_old"](made_input(6)).q_stamp is None
    assert at["late"](made_input(3)).late
    jumped = at["clock_jump"](made_input(3))
    assert jumped.time == pytest.approx(3600.3)
    assert jumped.scans[0].stamp == pytest.approx(3600.3)
    assert at["clock_jump"](made_input(6)).time == pytest.approx(0.6)


def test_dropout_loses_the_share_asked_for_and_the_same_zones_with_a_seed() -> None:
    first, second = (faulty(injected("dropout", value=0.3)) for _ in range(2))
    lost = []
    for a, b in zip(first.values(), second.values(), strict=True):
        assert a is not None
        assert b is not None
        assert bytes(a.status) == bytes(b.status)
        lost.append(float((a.status == NO_TARGET).mean()))
    assert statistics.mean(lost) == pytest.approx(0.3, abs=0.12)


def test_an_offset_moves_targets_only() -> None:
    for counter, scan in faulty(injected("offset", value=-0.2)).items():
        assert scan is not None
        np.testing.assert_allclose(scan.ranges[1:], 0.3 + 0.001 * counter)
        assert scan.ranges[0] == 0.0


def test_delayed_scans_come_late_with_their_true_stamp() -> None:
    arrived = {
        counter: scan
        for counter, scans in through(injected("delay", value=0.15))
        if (scan := scans.get(2)) is not None and scan.counter != counter
    }
    assert {at: scan.counter for at, scan in arrived.items()} in ({5: 3}, {5: 3, 6: 4, 7: 5})


def test_a_fault_of_all_sensors_reaches_the_controllers_findings(ur10e: px.Robot) -> None:
    fault = "fault=[{kind='silent', from=0.4}]"
    log = run_trial(load_scenario("front_plane", [*SHORT, fault]), "wb", robot=ur10e)
    assert log.findings.get("all_sensors_silent", 0) > 0
    assert log.mode[-1] == px.Mode.HOLD.value
    np.testing.assert_allclose(log.qd[-1], 0.0, atol=1e-12)


def test_faults_are_part_of_the_recorded_inputs(ur10e: px.Robot, tmp_path: Path) -> None:
    scenario = load_scenario("front_plane", ["duration=0.5", "fault=[{kind='nan', sensor=0}]"])
    with Recorder(tmp_path / "a.mcap") as recorder:
        run_trial(scenario, "wb", robot=ur10e, recorder=recorder)
    recording = read_recording(tmp_path / "a.mcap")
    scans = itertools.chain.from_iterable(tick.inputs.scans for tick in recording.ticks)
    assert all(np.isnan(scan.ranges).all() == (scan.sensor == 0) for scan in scans)
    assert first_difference(recording) is None


def test_snapshots_hold_both_clouds_of_their_tick(recording: Recording) -> None:
    first, last = recorded_moments(recording, [1.0, 99.0])
    assert first.tick.inputs.time == pytest.approx(1.0)
    assert last.tick.inputs.time == pytest.approx(2.99)
    for snapshot in (first, last):
        assert len(snapshot.clouds.removed_W) > 0
        assert len(snapshot.clouds.kept_W) == snapshot.tick.result.cloud_points


def test_recorded_clouds_are_those_that_a_replay_gives(recording: Recording) -> None:
    times = np.arange(0.0, 3.0, 0.07).tolist()
    older = replace(recording, cloud_messages=())
    recorded, repeated = (recorded_moments(each, times) for each in (recording, older))
    for then, now in zip(recorded, repeated, strict=True):
        assert then.tick.result.same(now.tick.result)
        assert then.elapsed == now.elapsed
        assert then.clouds.kept_W.tobytes() == now.clouds.kept_W.tobytes()
        assert then.clouds.removed_W.tobytes() == now.clouds.removed_W.tobytes()


def test_the_ticks_with_scans_bring_their_clouds_too(ur10e: px.Robot, tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap", "scans") as recorder:
        scenario = load_scenario("front_plane", ["duration=1.0"])
        run_trial(scenario, "wb", robot=ur10e, recorder=recorder)
    recording = read_recording(tmp_path / "a.mcap")
    moments = recorded_moments(recording, [0.0, 0.5, 9.0])
    assert [len(m.clouds.kept_W) for m in moments] == [m.tick.result.cloud_points for m in moments]
    assert [moment.elapsed for moment in moments] == pytest.approx([0.0, 0.54, 0.94])


def test_a_run_becomes_a_small_moving_picture(recording: Recording, tmp_path: Path) -> None:
    path, scenario = tmp_path / "a.gif", recording.settings.scenario
    world = World(make_robot(scenario), scenario.drawn())
    moments = recorded_moments(recording, np.arange(0.0, 3.0, 0.5).tolist())
    try:
        frames = [Image.fromarray(draw(world, moment, (240, 180))) for moment in moments]
    finally:
        world.close()
    write_gif(frames, path, 2.0)
    with Image.open(path) as image:
        assert image.n_frames == 6  # type: ignore[attr-defined]
        assert image.size == (240, 180)
    assert path.stat().st_size < 300_000


def check_bounds(runs: Runs, seed: int) -> None:
    """The bounds of the experiment with the two static planes."""
    front = {name: runs("front_plane", name, seed).summary() for name in ("wb", "sm")}
    side = {name: runs("side_plane", name, seed).summary() for name in ("wb", "sm")}
    gains = [1000.0 * (s["wb"]["true_final_m"] - s["sm"]["true_final_m"]) for s in (front, side)]
    assert 110.0 <= gains[0] <= 230.0
    assert 0.19 <= front["wb"]["true_final_m"] <= 0.30
    assert 0.03 <= front["sm"]["true_final_m"] <= 0.14
    assert front["wb"]["true_min_m"] >= 0.14
    assert gains[1] >= 30.0
    assert 0.18 <= side["wb"]["true_final_m"] <= 0.30
    assert side["wb"]["true_min_m"] >= 0.11
    for summary in (*front.values(), *side.values()):
        assert summary["self_min_m"] >= 0.02


def test_the_static_planes_come_out_as_the_experiment_asks(runs: Runs) -> None:
    check_bounds(runs, seed=0)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(1, 10))
def test_the_static_planes_come_out_so_with_every_seed(runs: Runs, seed: int) -> None:
    check_bounds(runs, seed)


def test_a_clock_that_jumps_changes_neither_the_final_ticks_nor_those_recorded(
    ur10e: px.Robot, tmp_path: Path
) -> None:
    jump = 'fault=[{kind = "clock_jump", from = 0.3, value = -5.0}]'
    recorded = {}
    for name, overrides in (("healthy", ()), ("jumped", (jump,))):
        scenario = load_scenario("front_plane", ["duration=0.5", *overrides])
        with Recorder(tmp_path / name, "scans") as recorder:
            log = run_trial(scenario, "wb", robot=ur10e, recorder=recorder)
        assert log.elapsed == pytest.approx(np.arange(50) / 100)
        assert final_ticks(log.elapsed).all()
        recorded[name] = len(read_recording(tmp_path / name).ticks)
    assert log.time[-1] < 0.0
    assert recorded["jumped"] == recorded["healthy"]

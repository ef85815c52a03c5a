"""Mounts judged by what their sensors see of the arm itself."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

import proxcgal as px
from proxcgal.models import mount_check
from proxcgal.scenario.fault_keys import Fault
from proxcgal.scenario.loading import load_scenario
from proxcgal.scenario.scenario import Scenario
from proxcgal.scenario.setup import Setup
from proxcgal.sim.assembly import MOUNT_CHECK_SCANS
from proxcgal.sim.faults import RealMounts
from proxcgal.sim.source import SimulatedSource
from proxcgal.sim.world import World
from proxcgal.trial.trial import run_trial

SCENES = ("front_plane", "side_plane", "timing_ur10e", "timing_panda")
SIGNS = ("", "-")


def looked(setup: Setup, faults: tuple[Fault, ...] = (), seed: int = 0) -> px.MountChecks:
    own = replace(setup, scenario=setup.scenario.model_copy(update={"faults": faults}))
    source = SimulatedSource(own, World(own.robot, own.scene), seed)
    return px.check_mounts(own.robot, own.skin, own.q0, source.standing(MOUNT_CHECK_SCANS))


@pytest.fixture(scope="module", params=SCENES)
def setup(request: pytest.FixtureRequest) -> Setup:
    return Setup.of(load_scenario(request.param, ["vertices_per_link=1000"]))


def wrong_mount(sensor: int, axis: str, sign: float = 1.0) -> Fault:
    kind = "mount_turn" if axis.startswith("turn") else "mount_offset"
    size = np.deg2rad(2.0) if axis.startswith("turn") else 0.005
    return Fault.model_validate(
        {"kind": kind, "sensor": sensor, "axis": axis[-1], "value": sign * float(size)}
    )


def test_noise_alone_makes_no_mount_wrong(setup: Setup) -> None:
    for seed in range(10):
        checks = looked(setup, seed=seed)
        assert checks, checks.wrong
        assert 2 <= checks.judged <= len(checks.sensors)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_5_mm_or_2_degrees_are_found_wherever_the_check_says_that_it_can(
    setup: Setup, sign: float
) -> None:
    seen = [(c.sensor, axis) for c in looked(setup).sensors for axis in c.visible]
    assert {axis[:4] for _, axis in seen} & {"x", "y", "z"}
    for axis in {axis for _, axis in seen}:  # several sensors at once
        sensors = [sensor for sensor, other in seen if other == axis]
        faults = tuple(wrong_mount(sensor, axis, sign) for sensor in sensors)
        wrong = looked(setup, faults, seed=5).wrong
        assert [check.sensor for check in wrong] == sensors, axis


def test_the_size_is_told_where_the_view_fixes_it() -> None:
    setup = Setup.of(load_scenario("timing_ur10e", ["vertices_per_link=1000"]))
    (check,) = looked(setup, (wrong_mount(28, "z"),)).wrong
    assert check.name == "forearm_link/ring2/8"
    assert 0.003 < check.shift < 0.008
    (check,) = looked(setup, (wrong_mount(18, "turn x"),)).wrong
    assert np.deg2rad(1.0) < check.turn < np.deg2rad(3.0)


def test_a_sensor_that_sees_no_body_is_not_judged(setup: Setup) -> None:
    blind = [check.sensor for check in looked(setup).sensors if not check.zones]
    assert blind
    faults = tuple(wrong_mount(sensor, "z") for sensor in blind)
    checks = looked(setup, faults)
    assert not set(blind) & {check.sensor for check in checks.wrong}
    assert not any(checks.sensors[sensor].visible for sensor in blind)


def test_something_before_the_body_makes_no_mount_wrong(setup: Setup) -> None:
    source = SimulatedSource(setup, World(setup.robot, setup.scene), 0)
    scans = []
    for scan in source.standing(MOUNT_CHECK_SCANS):
        ranges = np.array(scan.ranges)
        ranges[::3] = np.maximum(ranges[::3] - 0.07, 0.0)  # too near to be told is nothing told
        scans.append(px.Scan(scan.sensor, scan.counter, scan.stamp, ranges, scan.status))
    near = px.check_mounts(setup.robot, setup.skin, setup.q0, scans)
    assert near
    assert sum(c.zones for c in near.sensors) < sum(c.zones for c in looked(setup).sensors)


def test_a_sensor_that_looks_elsewhere_altogether_is_wrong() -> None:
    setup = Setup.of(load_scenario("timing_ur10e", ["vertices_per_link=1000", "obstacle=[]"]))
    away = Fault.model_validate({"kind": "mount_turn", "sensor": 28, "axis": "y", "value": 2.5})
    assert 28 in [check.sensor for check in looked(setup, (away,)).wrong]


def test_scans_of_another_skin_are_refused(setup: Setup) -> None:
    scan = px.Scan(99, 0, 0.0, np.full(64, 0.5), np.full(64, 5, np.uint8))
    with pytest.raises(px.ConfigError, match="scan of sensor 99: the skin has 0 to 29"):
        px.check_mounts(setup.robot, setup.skin, setup.q0, [scan])


def test_the_threshold_is_passed_once_in_a_million() -> None:
    assert pytest.approx(chi2.isf(1e-6, 6), rel=1e-5) == mount_check.THRESHOLD


def test_a_mount_fault_moves_only_its_sensor_and_only_for_its_time(setup: Setup) -> None:
    fault = Fault.model_validate(
        {"kind": "mount_offset", "sensor": 3, "from": 1.0, "to": 2.0, "value": 0.02}
    )
    real = RealMounts(setup.robot, setup.skin.mounts, [fault], seed=4)
    right = np.array([mount.T_LS for mount in setup.skin.mounts])
    np.testing.assert_array_equal(real.at(0.5), right)
    np.testing.assert_array_equal(real.at(2.0), right)
    moved = real.at(1.0) - right
    assert np.linalg.norm(moved[3, :3, 3]) == pytest.approx(0.02)
    assert not np.delete(moved, 3, axis=0).any()


def test_a_turned_mount_stays_a_pose(setup: Setup) -> None:
    fault = Fault.model_validate({"kind": "mount_turn", "sensor": "all", "value": 0.3})
    mounts = setup.skin.mounts
    turned = RealMounts(setup.robot, mounts, [fault], 1).at(0.0)
    for T_LS, mount in zip(turned, mounts, strict=True):
        by = np.asarray(mount.T_LS)[:3, :3].T @ T_LS[:3, :3]
        np.testing.assert_allclose(by @ by.T, np.eye(3), atol=1e-12)
        assert np.arccos((np.trace(by) - 1.0) / 2.0) == pytest.approx(0.3)


WRONG = "fault=[{kind='mount_offset', sensor=28, axis='z', value=0.005}]"


def short(*overrides: str) -> Scenario:
    return load_scenario("timing_ur10e", ["duration=0.05", "vertices_per_link=1000", *overrides])


def test_a_run_with_a_wrong_mount_is_refused_and_runs_where_the_check_is_off() -> None:
    with pytest.raises(px.ConfigError, match=r"sensor 28 \(forearm_link/ring2/8\): off by about"):
        run_trial(short(WRONG), "wb")
    assert len(run_trial(short(WRONG, "skin.check_mounts=false"), "wb").time) == 5
    assert len(run_trial(short(WRONG), "wb_known").time) == 5  # no sensor is asked


def test_the_check_changes_no_command_of_a_run_that_begins() -> None:
    with_check, without = (
        run_trial(short(f"skin.check_mounts={text}"), "wb") for text in ("true", "false")
    )
    assert with_check.qd.tobytes() == without.qd.tobytes()


def test_the_command_refuses_with_exit_code_2_and_writes_nothing(
    call: Callable[..., object], tmp_path: object
) -> None:
    answer = call("run", "timing_ur10e", "--controller", "wb", "--set", WRONG, "--out", "there")
    code, _, err = answer  # type: ignore[misc]
    assert code == 2
    assert "sensor 28" in err
    assert "skin.check_mounts=false" in err
    assert "Traceback" not in err
    assert list(tmp_path.iterdir()) == []  # type: ignore[attr-defined]

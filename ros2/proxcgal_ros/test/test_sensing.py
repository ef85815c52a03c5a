"""What the node makes of sensors: clouds, ages, and HOLD where they fall silent."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from proxcgal_msgs.msg import Proximity, SensorArray
from proxcgal_ros.convert import SECOND, cloud_rows, nanoseconds, pose_of
from rcl_interfaces.srv import DescribeParameters, SetParameters
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Float64MultiArray
from visualization_msgs.msg import Marker, MarkerArray

from conftest import (
    PATIENCE,
    PATIENT,
    Client,
    Processes,
    endless_goal,
    goal,
    joint_bounds,
)
from proxcgal.recording.reader import read_recording
from proxcgal.scenario.loading import load_scenario
from proxcgal.scenario.setup import Setup


def started(processes: Processes, client: Client, *arguments: str) -> Client:
    """A client of a node and an arm; its sensors are a process of their own."""
    processes.start("node", "node", *arguments)
    processes.start("arm", "sim", "front_plane", "--only", "arm", "--set", "duration=1000.0")
    processes.start("sensors", "sim", "front_plane", "--only", "scans")
    heard = client.listen(Proximity, "proximity")
    running = client.until(lambda: heard and heard[-1][1].mode == Proximity.RUN)
    assert running, processes.said("node")
    return client


@pytest.fixture
def arm(processes: Processes, client: Client) -> Client:
    return started(processes, client, *PATIENT)


def stamp(message: Any) -> int:
    """Of its header [ns]."""
    return nanoseconds(message.header.stamp)


def test_clouds_have_the_frame_and_the_stamp_of_what_was_measured(arm: Client) -> None:
    # How often they come: test_pacing.py.
    clouds = arm.listen(PointCloud2, "cloud")
    arrays = arm.listen(SensorArray, "scans/forearm_link/ring0")
    joints = arm.listen(JointState, "joint_states")
    shown = arm.listen(MarkerArray, "markers")
    commands = arm.listen(Float64MultiArray, "velocity_controller/commands")
    arm.send(endless_goal())
    measured: set[int] = set()
    known: list[PointCloud2] = []

    def enough() -> bool:
        """Of clouds, scans and joint states this process may not hear every one."""
        measured.update(nanoseconds(one.stamp) for _, array in arrays for one in array.scans)
        known[:] = [cloud for _, cloud in clouds if stamp(cloud) in measured and cloud.width]
        marks = {mark.ns for _, array in shown for mark in array.markers}
        return len(known) > 20 and len(marks) == 2 and len(pairs()) > 10

    def pairs() -> list[Proximity]:
        stamped = {stamp(state) for _, state in joints}
        return [near for _, near in arm.modes() if near.link and stamp(near) in stamped]

    assert arm.until(enough)
    assert {cloud.header.frame_id for _, cloud in clouds} == {"base_link"}
    assert np.all(np.diff([stamp(cloud) for _, cloud in clouds]) > 0)

    # The panel, and nothing of the arm: its near face stands at x = 0.817 in the base frame.
    points = np.concatenate([cloud_rows(cloud) for cloud in known])
    assert np.median(points["x"]) == pytest.approx(0.817, abs=0.05)
    assert set(points["sensor"]) <= set(range(30))

    # The pair is that of the cloud, in its frame and of the joint state's stamp.
    for near in pairs()[::5]:
        apart = [getattr(near.surface, k) - getattr(near.obstacle, k) for k in "xyz"]
        assert near.distance == pytest.approx(np.linalg.norm(apart), abs=1e-9)
        assert near.header.frame_id == "base_link"
        assert 0.0 <= near.activation <= 1.0

    marks = {mark.ns: mark for _, array in shown for mark in array.markers}
    assert set(marks) == {"proxcgal/closest_pair", "proxcgal/fields_of_view"}
    views = marks["proxcgal/fields_of_view"]
    assert (views.type, len(views.points)) == (Marker.LINE_LIST, 30 * 8 * 2)
    assert views.header.frame_id == "base_link"
    assert {len(command.data) for _, command in commands} == {6}


def test_a_killed_sensor_publisher_brings_hold_within_200_ms(
    client: Client, processes: Processes, tmp_path: Path
) -> None:
    record = tmp_path / "hold.mcap"
    arm = started(processes, client, *PATIENT, "-p", f"record:={record}")
    told = arm.listen(DiagnosticArray, "/diagnostics")
    heard = arm.modes()
    commands = arm.listen(Float64MultiArray, "velocity_controller/commands")
    arm.send(endless_goal())
    assert arm.moving()
    processes.kill("sensors")
    killed = time.monotonic()
    assert arm.until(lambda: heard[-1][1].mode == Proximity.HOLD)

    # And the arm rests, within its limits: it is told zero.
    del commands[:]
    assert arm.until(lambda: commands and not np.any(commands[-1][1].data))
    del told[:]
    assert arm.until(lambda: told and silent_for(told[-1][1]) > 0.5)
    levels = {status.name: status for status in told[-1][1].status}
    assert levels["proxcgal: controller"].message == "HOLD"
    assert levels[SENSOR].level == DiagnosticStatus.ERROR
    assert len(levels) == 31

    # New scans, and it goes on by itself.
    processes.start("again", "sim", "front_plane", "--only", "scans", "--seed", "9")
    began = time.monotonic()
    assert arm.until(lambda: heard[-1][1].mode == Proximity.RUN), heard[-1][1].findings

    # By the node's own clock, the machine's: no matter when this process heard of it. A scan that
    # was sent before the kill may have been taken after it, where the node stood still.
    assert processes.end("node") == 0
    ticks = [tick for tick in read_recording(record).ticks if tick.inputs.time < began]
    scans = max(tick.inputs.time for tick in ticks if tick.inputs.scans)
    late = [t for t in ticks if t.inputs.time > max(killed, scans) + 0.2]
    assert late
    assert {tick.result.mode for tick in late} == {Proximity.HOLD}
    reasons = {found.reason for tick in late for found in tick.result.findings}
    assert {"all_sensors_silent", "array_silent"} & reasons


SENSOR = "proxcgal: sensor forearm_link/ring0/0"


def silent_for(message: DiagnosticArray) -> float:
    """[s] that the first sensor has told nothing."""
    (status,) = [one for one in message.status if one.name == SENSOR]
    return float(status.values[0].value)


def test_joint_states_that_stop_hold_the_arm_and_then_stop_it(
    client: Client, processes: Processes, tmp_path: Path
) -> None:
    hold, stop = 1.0, 4.0  # [s]
    record = tmp_path / "stop.mcap"
    arm = started(processes, client, *joint_bounds(hold, stop), "-p", f"record:={record}")
    heard = arm.modes()
    handle = arm.send(endless_goal())
    assert arm.moving()
    processes.kill("arm")
    assert arm.until(lambda: heard[-1][1].mode == Proximity.STOP)
    ended = arm.result(handle)
    assert ended.result.result == "aborted"
    assert ended.result.reason.startswith("the monitor stopped the arm: ")
    assert "joint_state_lost" in ended.result.reason

    # Latched: joint states are back, it stays, and takes no goal.
    last = stamp(heard[-1][1])
    processes.start("back", "sim", "front_plane", "--only", "arm")
    assert arm.until(lambda: stamp(heard[-1][1]) > last + SECOND)
    assert heard[-1][1].mode == Proximity.STOP
    assert not arm.send(goal(z=0.1)).accepted

    # Each at its age of the joint state, by the node's own clock.
    assert processes.end("node") == 0
    ticks = read_recording(record).ticks
    stopped = next(row for row, tick in enumerate(ticks) if tick.result.mode == Proximity.STOP)
    ages = [tick.inputs.time - tick.inputs.q_stamp for tick in ticks[: stopped + 1]]
    assert max(ages[:-1]) <= stop < ages[-1]
    held = [t for t, age in zip(ticks[:stopped], ages, strict=False) if age > hold]
    assert {tick.result.mode for tick in held} <= {Proximity.HOLD}


def test_parameters_tell_their_range_and_change_what_the_arm_does(
    client: Client, processes: Processes
) -> None:
    # Slowly: it is on its way for long enough to be told of.
    arm = started(processes, client, *PATIENT, "-p", "max_linear:=0.1")

    def change(**values: object) -> list[str]:
        request = SetParameters.Request()
        request.parameters = [
            Parameter(name, value=value).to_parameter_msg() for name, value in values.items()
        ]
        answer = arm.ask(request, SetParameters, "/proxcgal/set_parameters")
        return [result.reason for result in answer.results if not result.successful]

    names = ["d_min", "buffer", "avoid_gain", "reach_gain", "max_linear", "max_angular",
             "goal_timeout", "position_tolerance", "angle_tolerance", "cloud_hz"]  # fmt: skip
    request = DescribeParameters.Request(names=[*names, "scenario", "second_goal"])
    told = arm.ask(request, DescribeParameters, "/proxcgal/describe_parameters").descriptors
    for one in told[: len(names)]:
        assert one.description, one.name
        (allowed,) = one.floating_point_range
        assert allowed.from_value < allowed.to_value
    assert told[len(names)].read_only
    assert told[-1].additional_constraints

    assert change(d_min=5.0)
    assert change(scenario="side_plane")
    assert change(second_goal="both") == ["second_goal = 'both': one of preempt, refuse"]

    # Slower, from now on, while it moves.
    handle = arm.send(endless_goal())
    assert arm.moving(0.08)
    assert change(max_linear=0.03) == []
    assert arm.until(lambda: 0.01 < arm.feedback[-1].linvel_norm < 0.04)

    assert change(second_goal="refuse") == []
    assert not arm.send(goal(z=0.1)).accepted
    assert change(goal_timeout=0.2) == []
    assert "not reached within 0.2 s" in arm.result(handle).result.reason

    goals = arm.listen(PoseStamped, "goal", latched=True)
    assert arm.until(lambda: goals)
    setup = Setup.of(load_scenario("front_plane"))
    assert np.isfinite(pose_of(goals[-1][1])).all()
    assert goals[-1][1].header.frame_id == "base_link"
    assert setup.robot.n_q == 6
    assert "Traceback" not in processes.said("node")


def test_sensors_that_sit_elsewhere_end_the_node_before_it_commands(
    client: Client, processes: Processes
) -> None:
    commands = client.listen(Float64MultiArray, "velocity_controller/commands")
    elsewhere = "fault=[{kind='mount_turn', sensor=28, axis='x', value=0.1}]"
    processes.start("sim", "sim", "front_plane", "--set", "duration=1000.0", elsewhere)
    checked = ("-p", "check_mounts:=true")
    node = processes.start("wrong", "node", *PATIENT, *checked)
    assert client.until(lambda: node.poll() is not None), processes.said("wrong")
    assert node.returncode == 2
    said = processes.said("wrong")
    assert "sensors do not sit where the skin says" in said
    assert "Traceback" not in said
    assert all(not np.any(command.data) for _, command in commands)

    assert processes.end("sim") == 0
    processes.start("as_said", "sim", "front_plane", "--set", "duration=1000.0")
    heard = client.listen(Proximity, "proximity")
    processes.start("right", "node", *PATIENT, *checked)
    assert client.until(lambda: heard and heard[-1][1].mode == Proximity.RUN)
    assert "none wrong" in processes.said("right")


@pytest.mark.parametrize(
    ("inputs", "told"),
    [
        ("d_min:=5.0", "d_min = 5.0: must be a number with a point, such as 0.2, from 0.02 to 1"),
        ("d_min:=1", "d_min = 1: must be a number with a point"),
        ("d_min:=near", "d_min = near: must be a number with a point"),
        ("scenario:=3", "scenario = 3: must be a text"),
        ("reset_service:=2", "reset_service = 2: must be true or false"),
        ("controller:=best", "controller = 'best': must be wb or sm or wb_memory"),
        ("limit:=none", "limit = 'none': must be full or papers"),
    ],
)
def test_a_parameter_that_cannot_be_ends_the_node_with_a_line(
    processes: Processes, inputs: str, told: str
) -> None:
    assert processes.start("node", "node", "--ros-args", "-p", inputs).wait(PATIENCE) == 2
    assert f"error: parameter {told}" in processes.said("node")
    assert "Traceback" not in processes.said("node")


def test_a_parameter_that_the_node_does_not_know_is_told(processes: Processes) -> None:
    inputs = ("-p", "d_mim:=0.3", "-p", "second_goal:=preempt", "-p", "limit:=papers")
    processes.start("node", "node", "--ros-args", *inputs)
    told = "parameter d_mim: not known, it changes nothing; did you mean d_min?"
    end = time.monotonic() + PATIENCE
    while told not in processes.said("node") and time.monotonic() < end:
        time.sleep(0.05)
    assert told in processes.said("node")
    assert "second_goal: not known" not in processes.said("node")
    assert "limit:=papers: only the joints' limits hold" in processes.said("node")

"""What the node makes of sensors: clouds, ages, and HOLD where they fall silent."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from proxcgal_msgs.msg import Proximity, SensorArray
from proxcgal_ros.convert import cloud_rows, nanoseconds, pose_of
from rcl_interfaces.srv import DescribeParameters, SetParameters
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Float64MultiArray
from visualization_msgs.msg import Marker, MarkerArray

from conftest import PATIENT, Client, Processes, goal, joint_bounds
from proxcgal.sim.recording import read_recording
from proxcgal.sim.scenario import load_scenario
from proxcgal.sim.setup import Setup


def started(processes: Processes, client: Client, *arguments: str) -> Client:
    """A client of a node and an arm; its sensors are a process of their own."""
    processes.start("node", "node", *arguments)
    processes.start("arm", "sim", "front_plane", "--only", "arm", "--set", "duration=1000.0")
    processes.start("sensors", "sim", "front_plane", "--only", "scans")
    heard = client.listen(Proximity, "proximity")
    running = client.until(lambda: heard and heard[-1][1].mode == Proximity.RUN, 40.0)
    assert running, processes.said("node")
    return client


@pytest.fixture
def arm(processes: Processes, client: Client) -> Client:
    return started(processes, client, *PATIENT)


def test_clouds_come_at_the_sensors_rate_with_their_frame_and_stamp(arm: Client) -> None:
    clouds = arm.listen(PointCloud2, "cloud")
    arrays = arm.listen(SensorArray, "scans/forearm_link/ring0")
    joints = arm.listen(JointState, "joint_states")
    shown = arm.listen(MarkerArray, "markers")
    commands = arm.listen(Float64MultiArray, "velocity_controller/commands")
    arm.send(goal(z=0.4))
    arm.spin(6.0)
    # By their own stamps, and by the median: where this machine stands still, one interval is long.
    stamps = [nanoseconds(cloud.header.stamp) * 1e-9 for _, cloud in clouds[1:]]
    rate = 1.0 / np.median(np.diff(stamps))
    print(f"clouds: {rate:.2f} Hz, median of {len(stamps) - 1} intervals")
    assert len(stamps) > 30
    assert rate == pytest.approx(15.0, rel=0.1)

    measured = {nanoseconds(scan.stamp) for _, array in arrays for scan in array.scans}
    inner = [cloud for at, cloud in clouds if at < clouds[-1][0] - 0.2][2:]
    assert {cloud.header.frame_id for cloud in inner} == {"base_link"}
    stamps = [nanoseconds(cloud.header.stamp) for cloud in inner]
    known = [stamp for stamp in stamps if stamp >= min(measured)]  # this process may hear one later
    assert len(known) > 20
    assert set(known) <= measured
    assert np.all(np.diff(stamps) > 0.0)

    # The panel, and nothing of the arm: its near face stands at x = 0.817 in the base frame.
    points = np.concatenate([cloud_rows(cloud) for cloud in inner])
    assert len(points) > 0
    assert np.median(points["x"]) == pytest.approx(0.817, abs=0.05)
    assert set(points["sensor"]) <= set(range(30))

    # The pair is that of the cloud, in its frame and of the joint state's stamp.
    stamped = {nanoseconds(state.header.stamp) for _, state in joints}
    pairs = [near for at, near in arm.modes() if at > joints[0][0] + 0.5 and near.link]
    pairs = [near for near in pairs if nanoseconds(near.header.stamp) in stamped]
    assert len(pairs) > 10
    for near in pairs[::20]:
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
    arm.send(goal(z=0.3))
    arm.spin(0.5)
    assert arm.until(lambda: all(near.mode == Proximity.RUN for _, near in heard[-20:]), 30.0)
    processes.kill("sensors")
    killed = time.monotonic()
    assert arm.until(lambda: heard[-1][1].mode == Proximity.HOLD, 5.0)

    # And the arm rests, within its limits: it is told zero.
    arm.spin(1.0)
    assert max(np.abs(commands[-1][1].data)) == 0.0
    levels = {status.name: status for status in told[-1][1].status}
    assert levels["proxcgal: controller"].message == "HOLD"
    sensor = levels["proxcgal: sensor forearm_link/ring0/0"]
    assert sensor.level == DiagnosticStatus.ERROR
    assert float(sensor.values[0].value) > 0.5
    assert len(levels) == 31

    # New scans, and it goes on by itself.
    processes.start("again", "sim", "front_plane", "--only", "scans", "--seed", "9")
    began = time.monotonic()
    assert arm.until(lambda: heard[-1][1].mode == Proximity.RUN, 60.0), heard[-1][1].findings

    # By the node's own clock, the machine's: no matter when this process heard of it. A scan that
    # was sent before the kill may have been taken after it, where the node stood still.
    assert processes.end("node") == 0
    ticks = [tick for tick in read_recording(record).ticks if tick.given.time < began]
    scans = max(tick.given.time for tick in ticks if tick.given.scans)
    first = next(t for t in ticks if t.given.time > killed and t.result.mode == Proximity.HOLD)
    print(f"HOLD {1e3 * (first.given.time - killed):.0f} ms after the kill")
    assert {"all_sensors_silent", "array_silent"} & {one.reason for one in first.result.findings}
    late = [t for t in ticks if t.given.time > max(killed, scans) + 0.2]
    assert len(late) > 50
    assert {tick.result.mode for tick in late} == {Proximity.HOLD}


def test_joint_states_that_stop_hold_the_arm_and_then_stop_it(
    client: Client, processes: Processes
) -> None:
    arm = started(processes, client, *joint_bounds(0.1, 0.6))
    heard = arm.modes()
    handle = arm.send(goal(z=0.4))
    arm.spin(0.5)
    processes.kill("arm")
    assert arm.until(lambda: heard[-1][1].mode == Proximity.STOP, 5.0)
    assert "joint_state_stale" in {reason for _, near in heard for reason in near.findings}
    ended = arm.result(handle)
    assert ended.result.result == "aborted"
    assert ended.result.reason.startswith("the monitor stopped the arm: ")
    assert "joint_state_lost" in ended.result.reason

    # Latched: joint states are back, it stays, and takes no goal.
    processes.start("back", "sim", "front_plane", "--only", "arm")
    arm.spin(3.0)
    assert heard[-1][1].mode == Proximity.STOP
    assert not arm.send(goal(z=0.1)).accepted


def test_parameters_tell_their_range_and_change_what_the_arm_does(
    arm: Client, processes: Processes
) -> None:
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
    handle = arm.send(goal(z=0.35))
    assert arm.until(lambda: arm.feedback and arm.feedback[-1].linvel_norm > 0.15, 10.0)
    assert change(max_linear=0.05) == []
    assert arm.until(lambda: 0.03 < arm.feedback[-1].linvel_norm < 0.07, 5.0)

    assert change(second_goal="refuse") == []
    assert not arm.send(goal(z=0.1)).accepted
    assert change(goal_timeout=0.2) == []
    assert "not reached within 0.2 s" in arm.result(handle).result.reason

    goals = arm.listen(PoseStamped, "goal", latched=True)
    assert arm.until(lambda: goals, 5.0)
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
    assert client.until(lambda: node.poll() is not None, 60.0), processes.said("wrong")
    assert node.returncode == 2
    said = processes.said("wrong")
    assert "sensors do not sit where the skin says" in said
    assert "Traceback" not in said
    assert all(not np.any(command.data) for _, command in commands)

    assert processes.end("sim") == 0
    processes.start("as_said", "sim", "front_plane", "--set", "duration=1000.0")
    heard = client.listen(Proximity, "proximity")
    processes.start("right", "node", *PATIENT, *checked)
    assert client.until(lambda: heard and heard[-1][1].mode == Proximity.RUN, 60.0)
    assert "none wrong" in processes.said("right")


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ("d_min:=5.0", "d_min = 5.0: must be a number with a point, such as 0.2, from 0.02 to 1"),
        ("d_min:=1", "d_min = 1: must be a number with a point"),
        ("d_min:=near", "d_min = near: must be a number with a point"),
        ("scenario:=3", "scenario = 3: must be a text"),
        ("reset_service:=2", "reset_service = 2: must be true or false"),
        ("controller:=best", "controller = 'best': must be wb or sm or wb_memory"),
    ],
)
def test_a_parameter_that_cannot_be_ends_the_node_with_a_line(
    processes: Processes, given: str, told: str
) -> None:
    assert processes.start("node", "node", "--ros-args", "-p", given).wait(30.0) == 2
    assert f"error: parameter {told}" in processes.said("node")
    assert "Traceback" not in processes.said("node")

"""Recordings as ROS 2 bags and back through the controller."""

from __future__ import annotations

import shutil
from collections import Counter
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from proxcgal_msgs.msg import Proximity, SensorArray
from proxcgal_ros.bag_read import replay_bag
from proxcgal_ros.bag_write import write_bag
from proxcgal_ros.bags import typestore
from proxcgal_ros.convert import cloud_rows, nanoseconds, pose_of, quaternion, rotation
from rclpy.serialization import deserialize_message
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState, PointCloud2

from proxcgal.core.errors import ConfigError
from proxcgal.recording.reader import Recording, read_recording
from proxcgal.recording.writer import Recorder
from proxcgal.scenario.loading import load_scenario
from proxcgal.trial.trial import run_trial


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """Two seconds of front_plane, in which the panel is approached."""
    path = tmp_path_factory.mktemp("bags") / "wb.mcap"
    scenario = load_scenario("front_plane", ["duration=2.0"])
    with Recorder(path) as recorder:
        run_trial(scenario, "wb", recorder=recorder)
    return read_recording(path)


@pytest.fixture(scope="module")
def bag(recording: Recording) -> tuple[Path, dict[str, int]]:
    path = recording.path.parent / "bag"
    return path, write_bag(recording.path, path)


def test_a_bag_is_read_back_with_all_messages(
    recording: Recording, bag: tuple[Path, dict[str, int]]
) -> None:
    path, counts = bag
    ticks = len(recording.ticks)
    beats = sum(bool(tick.inputs.scans) for tick in recording.ticks)
    assert counts == {
        "/scenario": 1, "/goal": 1, "/joint_states": ticks, "/proximity": ticks,
        "/velocity_controller/commands": ticks, "/cloud": beats,
        **{f"/scans/forearm_link/ring{ring}": beats for ring in range(3)},
    }  # fmt: skip
    found: Counter[str] = Counter()
    with AnyReader([path], default_typestore=typestore()) as reader:
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)
            found[connection.topic] += 1
    assert dict(found) == counts
    # An independent reader finds the same in the one MCAP file.
    (file,) = path.glob("*.mcap")
    with file.open("rb") as stream:
        statistics = make_reader(stream).get_summary().statistics
    assert statistics.message_count == sum(counts.values())


def test_a_damaged_recording_is_told_and_its_bag_holds_what_comes_before(
    recording: Recording, tmp_path: Path
) -> None:
    data = recording.path.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: len(data) // 2])
    with pytest.warns(RuntimeWarning, match=r"cut\.mcap: damaged"):
        counts = write_bag(tmp_path / "cut.mcap", tmp_path / "bag")
    assert 0 < counts["/joint_states"] < len(recording.ticks)


def test_what_ros_2_reads_in_a_bag_is_what_was_recorded(
    recording: Recording, bag: tuple[Path, dict[str, int]]
) -> None:
    kinds = {"/joint_states": JointState, "/proximity": Proximity, "/cloud": PointCloud2,
             "/scans/forearm_link/ring2": SensorArray}  # fmt: skip
    told: dict[str, list[object]] = {topic: [] for topic in kinds}
    (file,) = bag[0].glob("*.mcap")
    with file.open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages(topics=list(kinds)):
            told[channel.topic].append(deserialize_message(message.data, kinds[channel.topic]))

    for tick, state, near in zip(
        recording.ticks, told["/joint_states"], told["/proximity"], strict=True
    ):
        assert list(state.position) == tick.inputs.q.tolist()
        assert nanoseconds(state.header.stamp) == round(tick.inputs.time * 1e9)
        assert (near.distance, near.link, near.mode) == (
            tick.result.seen, tick.result.link, tick.result.mode,
        )  # fmt: skip
    beats = [tick for tick in recording.ticks if tick.inputs.scans]
    for tick, array, cloud in zip(
        beats, told["/scans/forearm_link/ring2"], told["/cloud"], strict=True
    ):
        for scan, then in zip(array.scans, tick.inputs.scans[20:], strict=True):
            assert (scan.sensor + 20, scan.counter) == (then.sensor, then.counter)
            np.testing.assert_array_equal(scan.ranges, then.ranges)
            np.testing.assert_array_equal(scan.status, then.status)
        assert len(cloud_rows(cloud)) == tick.result.cloud_points
        assert cloud.header.frame_id == "base_link"


def test_a_bag_replayed_through_the_controller_gives_the_recorded_commands(
    recording: Recording, bag: tuple[Path, dict[str, int]], tmp_path: Path
) -> None:
    out = tmp_path / "again.mcap"
    told = replay_bag(bag[0], out=out)
    assert told["ticks"] == len(recording.ticks)
    assert told["scans"] == sum(len(tick.inputs.scans) for tick in recording.ticks)
    # Stamps are whole nanoseconds in a bag: no more than that is between them.
    assert told["command_difference"] < 1e-6
    least = min(tick.result.seen for tick in recording.ticks)
    assert told["seen_min_m"] == pytest.approx(least, abs=1e-6)
    again = read_recording(out)
    assert [tick.result.mode for tick in again.ticks] == [t.result.mode for t in recording.ticks]


def test_another_setting_gives_other_commands(bag: tuple[Path, dict[str, int]]) -> None:
    assert replay_bag(bag[0], changes=["controller.d_min=0.4"])["command_difference"] > 0.01


def test_what_is_no_bag_is_told_in_a_line(
    recording: Recording, bag: tuple[Path, dict[str, int]], tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match="no such file or folder"):
        replay_bag(tmp_path / "nothing")
    with pytest.raises(ConfigError, match="is there already"):
        write_bag(recording.path, bag[0])


@pytest.mark.parametrize("seed", range(6))
def test_a_damaged_bag_is_an_error_of_ours_at_most(
    bag: tuple[Path, dict[str, int]], tmp_path: Path, seed: int
) -> None:
    damaged = tmp_path / "damaged"
    shutil.copytree(bag[0], damaged)
    (file,) = damaged.glob("*.mcap")
    data = bytearray(file.read_bytes())
    random = np.random.default_rng(seed)
    if seed == 0:
        file.write_bytes(data[: len(data) // 2])
        with pytest.raises(ConfigError, match="cannot be read"):
            replay_bag(damaged)
    for place in random.integers(1000, len(data) - 2000, 20):
        data[place] ^= 0xFF
    file.write_bytes(data)
    with suppress(ConfigError):  # not every byte matters
        replay_bag(damaged)


@pytest.mark.parametrize("seed", range(20))
def test_quaternions_are_the_rotations_they_stand_for(seed: int) -> None:
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    np.testing.assert_allclose(rotation(quaternion(turn)), turn, atol=1e-12)


def test_a_pose_goes_through_a_message_unchanged() -> None:
    from proxcgal_ros.convert import header, pose_message

    from proxcgal.core import transforms

    T_WT = transforms.pose([0.3, -0.2, 0.9], [0.1, 1.2, -3.0])
    np.testing.assert_allclose(
        pose_of(pose_message(T_WT, header(0, "base_link"))), T_WT, atol=1e-12
    )

"""A recording becomes a ROS 2 bag: the topics of the node, as MCAP."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from proxcgal_msgs.msg import SensorArray
from rclpy.serialization import serialize_message
from rosbags.rosbag2 import StoragePlugin, Writer
from std_msgs.msg import String

from proxcgal.core.errors import ConfigError
from proxcgal.recording.reader import Recording, read_recording
from proxcgal.recording.replay import Replay
from proxcgal.scenario.setup import Setup
from proxcgal.sim.tick import Tick
from proxcgal_ros import topics
from proxcgal_ros.bags import exact, typestore
from proxcgal_ros.convert import (
    SECOND,
    cloud_message,
    command_message,
    header,
    joint_message,
    pose_message,
    proximity_message,
    scan_messages,
)

Message = tuple[str, int, Any]  # topic, log time [ns], what is told


def write_bag(recording: Path, bag: Path) -> dict[str, int]:
    """Writes every tick of a recording, and what the bag needs to be replayed.

    Clouds are computed again, from the recorded inputs, where every tick was recorded. Of a damaged
    recording the bag holds what comes before the damage, which a warning tells.

    Args:
        recording: MCAP file of proxcgal.
        bag: folder to make.

    Returns:
        How many messages each topic has.

    Raises:
        RecordingError: not a recording.
        ConfigError: the folder is there already, or cannot be made.
    """
    read = read_recording(recording)
    if read.damage:
        warnings.warn(f"{recording}: damaged: {read.damage}", RuntimeWarning, stacklevel=2)
    if bag.exists():
        raise ConfigError(f"bag {bag}: is there already")
    store = typestore()
    counts: Counter[str] = Counter()
    try:
        bag.parent.mkdir(parents=True, exist_ok=True)
        with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            connections: dict[str, Any] = {}
            for topic, stamp, message in _messages(read):
                kind = _type_name(message)
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=store)
                data = exact(serialize_message(message), kind, store)
                writer.write(connections[topic], stamp, data)
                counts[topic] += 1
    except OSError as error:
        raise ConfigError(f"bag {bag}: cannot be written: {error.strerror or error}") from None
    return dict(counts)


def _type_name(message: Any) -> str:
    package, _, _ = type(message).__module__.partition(".")
    return f"{package}/msg/{type(message).__name__}"


def _messages(read: Recording) -> Iterator[Message]:
    """All of the bag, in order of time; within a tick inputs come before what they brought."""
    setup = Setup.of(read.settings.scenario)
    arrays = topics.arrays([mount.name for mount in setup.skin.mounts])
    frame = topics.base_frame(setup.robot)
    links = {name: setup.skin.mounts[rows[0]].link for name, rows in arrays.items()}
    names = list(setup.robot.joint_names)
    start = round(read.ticks[0].inputs.time * SECOND) if read.ticks else 0
    yield _absolute(topics.SCENARIO), start, String(data=read.settings.scenario.to_toml())
    qd = np.zeros(len(names))
    goal: Any = None
    for tick, cloud in _with_clouds(read):
        inputs, result = tick.inputs, tick.result
        now = round(inputs.time * SECOND)
        stamps = [round(scan.stamp * SECOND) for scan in inputs.scans]
        for name, scans in scan_messages(inputs.scans, arrays, stamps).items():
            told = SensorArray(header=header(now, links[name]), scans=scans)
            yield _absolute(topics.scan_topic(name)), now, told
        if goal is None or not np.array_equal(goal, inputs.goal):
            goal = inputs.goal
            yield _absolute(topics.GOAL), now, pose_message(goal, header(now, frame))
        measured = now if inputs.q_stamp is None else round(inputs.q_stamp * SECOND)
        state = joint_message(names, inputs.q, qd, header(measured, ""))
        yield _absolute(topics.JOINT_STATES), now, state
        qd = result.qd
        yield _absolute(topics.COMMANDS), now, command_message(qd)
        head = header(measured, frame)
        yield _absolute(topics.PROXIMITY), now, proximity_message(result, head)
        if cloud is not None and inputs.scans:
            seen = header(max(stamps), frame)
            yield _absolute(topics.CLOUD), now, cloud_message(*cloud, seen)


def _with_clouds(read: Recording) -> Iterator[tuple[Tick, tuple[Any, Any] | None]]:
    """The recorded ticks, with the filtered cloud of each where it can be computed again."""
    if read.settings.ticks != "all":
        yield from ((tick, None) for tick in read.ticks)
        return
    again = Replay(read)
    for then, _ in zip(read.ticks, again, strict=True):
        yield then, (np.asarray(again.ctrl.cloud_W()), np.asarray(again.ctrl.cloud_origins()))


def _absolute(topic: str) -> str:
    return topic if topic.startswith("/") else f"/{topic}"

"""A bag's scans and joint states, given to a controller."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader

from proxcgal.core.errors import ConfigError
from proxcgal.recording.writer import Recorder, Settings
from proxcgal.scenario.loading import change_scenario, load_scenario, parse_scenario
from proxcgal.scenario.scenario import Scenario
from proxcgal.scenario.setup import Setup
from proxcgal.sim.loop import run_ticks
from proxcgal.sim.source import RecordedSource
from proxcgal.sim.tick import UNKNOWN, Tick, TickInput, TickResult
from proxcgal_ros import topics
from proxcgal_ros.bags import decoded, typestore
from proxcgal_ros.convert import SECOND, joint_positions, nanoseconds, pose_of, scans_of
from proxcgal_ros.restarts import Restarts

Array = NDArray[np.float64]


def replay_bag(
    bag: Path,
    *,
    scenario: str | None = None,
    controller: str | None = None,
    changes: Sequence[str] = (),
    out: Path | None = None,
) -> dict[str, Any]:
    """Gives a controller what a bag holds: a tick for each joint state.

    Topics are looked for by their names' ends, so that a namespace does no harm. Without a goal in
    the bag the tool is held where it starts.

    Args:
        bag: folder of a ROS 2 bag, of proxcgal_ros or of `ros2 bag record`.
        scenario: robot, skin and controller; left out: the one in the bag.
        controller: wb or sm; left out: wb.
        changes: `key=value` on the scenario.
        out: recording to write.

    Returns:
        Counts, the least distance seen, and how far the commands are from those in the bag.

    Raises:
        ConfigError: not a bag, no joint states or scans in it, no scenario.
    """
    content = _Content(bag)
    setup = Setup.of(_scenario(content, bag, scenario, changes))
    inputs = list(content.ticks(setup))
    if not inputs:
        raise ConfigError(
            f"bag {bag}: no joint states of {setup.robot.name}: "
            f"{topics.JOINT_STATES} with {', '.join(setup.robot.joint_names)} is needed; there are "
            f"{', '.join(sorted(content.topics)) or 'no topics'}"
        )
    name = controller or "wb"
    ctrl = setup.make_controller(name)
    recorder = None if out is None else Recorder(out)
    results: list[TickResult] = []
    try:
        if recorder is not None:
            recorder.start(
                Settings(
                    scenario=setup.scenario, controller=name, seed=setup.scenario.seed,
                    meshes=setup.mesh_hashes(),
                )
            )  # fmt: skip
        for tick, result in run_ticks(RecordedSource(inputs), ctrl):
            results.append(result)
            if recorder is not None:
                recorder.write(Tick(tick, result, UNKNOWN))
    finally:
        if recorder is not None:
            recorder.close()
    seen = min(result.seen for result in results)
    return {
        "ticks": len(results),
        "scans": sum(len(tick.scans) for tick in inputs),
        "seen_min_m": float(seen) if np.isfinite(seen) else None,
        "command_difference": _difference(content.commands, results),
    }


def _scenario(content: _Content, bag: Path, name: str | None, changes: Sequence[str]) -> Scenario:
    if name is not None:
        return load_scenario(name, changes)
    if content.scenario is None:
        raise ConfigError(f"bag {bag}: holds no scenario; name one with --scenario")
    return change_scenario(parse_scenario(content.scenario, str(bag)), str(bag), changes)


def _difference(commands: list[Array], results: Sequence[TickResult]) -> float | None:
    """[rad/s] or [m/s] the greatest between commands; None where the bag has not as many."""
    if len(commands) != len(results):
        return None
    apart = [np.abs(then - now.qd).max() for then, now in zip(commands, results, strict=True)]
    return float(max(apart, default=0.0))


class _Content:
    """A bag, read once."""

    def __init__(self, bag: Path) -> None:
        self.scenario: str | None = None
        self.commands: list[Array] = []
        self.topics: set[str] = set()
        self._messages: list[tuple[str, int, Any]] = []
        if not bag.exists():
            raise ConfigError(f"bag {bag}: no such file or folder")
        try:
            store = typestore()
            with AnyReader([bag], default_typestore=store) as reader:
                self.topics = {connection.topic for connection in reader.connections}
                for connection, stamp, data in reader.messages(connections=_wanted(reader)):
                    message = decoded(data, connection.msgtype, store)
                    self._take(connection.topic, stamp, message)
        except ConfigError:
            raise
        except Exception as error:  # readers do not say what a damaged file makes them raise
            reason = _reason(str(error) or type(error).__name__)
            raise ConfigError(f"bag {bag}: cannot be read: {reason}") from None

    def _take(self, topic: str, stamp: int, message: Any) -> None:
        if topic.endswith(f"/{topics.SCENARIO}"):
            self.scenario = message.data
        elif topic.endswith(f"/{topics.COMMANDS}"):
            self.commands.append(np.array(message.data, np.float64))
        else:
            self._messages.append((topic, stamp, message))

    def ticks(self, setup: Setup) -> Iterator[TickInput]:
        """What each tick is given."""
        names = list(setup.robot.joint_names)
        arrays = topics.arrays([mount.name for mount in setup.skin.mounts])
        rows_of = {f"/{topics.scan_topic(name)}": rows for name, rows in arrays.items()}
        restarts = Restarts(setup.scenario.controller.monitor.hold_after)
        scans: list[Any] = []
        goal: Array | None = None
        held: Array | None = None
        for topic, stamp, message in self._messages:
            now = stamp / SECOND
            if topic.endswith(f"/{topics.GOAL}"):
                goal = pose_of(message)
            elif topic.endswith(f"/{topics.JOINT_STATES}"):
                q = joint_positions(message, names)
                if q is None:
                    continue
                if held is None:
                    held = np.asarray(setup.robot.tool_pose(q))
                measured = nanoseconds(message.header.stamp) / SECOND
                inputs = tuple(scans)
                scans.clear()
                yield TickInput(now, q, held if goal is None else goal, inputs, q_stamp=measured)
            else:
                for end, rows in rows_of.items():
                    if topic.endswith(end):
                        scans += scans_of(message, rows, lambda ns: ns / SECOND, now, restarts)


def _reason(words: str) -> str:
    """What the reader says, in one line; it names no bag, or names it again."""
    return " ".join(words.split()).rstrip(".!")


def _wanted(reader: AnyReader) -> list[Any]:
    ends = (topics.SCENARIO, topics.COMMANDS, topics.GOAL, topics.JOINT_STATES)
    return [
        connection
        for connection in reader.connections
        if connection.topic.endswith(tuple(f"/{end}" for end in ends))
        or f"/{topics.SCANS}/" in connection.topic
    ]

"""A scenario's robot, simulated in real time behind the topics of a real one."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from proxcgal.sim.decisive import decisive_truth
from proxcgal.sim.scenario import Scenario
from proxcgal.sim.setup import Setup
from proxcgal.sim.source import SimulatedSource
from proxcgal.sim.ticks import TickInput
from proxcgal.sim.trial_log import NOTHING, TOO_CLOSE, final_ticks
from proxcgal.sim.world import World
from proxcgal_msgs.msg import SensorArray
from rclpy.executors import Executor
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from proxcgal_ros import topics
from proxcgal_ros.convert import (
    SECOND,
    header,
    joint_message,
    joint_positions,
    scan_messages,
)

Array = NDArray[np.float64]
Part = Literal["all", "arm", "scans"]

COMMAND_LIFE = 0.1  # [s] without a command; then the arm rests, as a robot's driver makes it
LONGEST_LAG = 0.1  # [s] that is caught up; what is lost beyond stays lost


class SimulatedRobot(Node):
    """Moves by its commands, and publishes where it stands and what its sensors measure.

    Real time: stamps are of now. Sensors alone (`part="scans"`) ride on the joint states that
    another process publishes; the arm alone has none.
    """

    def __init__(
        self, executor: Executor, running: Callable[[], bool], scenario: Scenario, seed: int,
        part: Part = "all",
    ) -> None:  # fmt: skip
        """Loads the scenario. Raises: ProxError."""
        super().__init__("proxcgal_robot")
        self._executor, self._running = executor, running
        self.setup = Setup.of(scenario)
        sensed = part != "arm"
        world = World(self.setup.robot, self.setup.scene) if sensed else None
        self._source = SimulatedSource(self.setup, world, seed)
        self._follows = part == "scans"
        self._names = list(self.setup.robot.joint_names)
        self._period = 1.0 / scenario.simulation.control_hz
        self._qd: Array = np.zeros(len(self._names))
        self._q: Array | None = None  # of another process
        self._commanded = -np.inf
        self.commands = 0  #: that came
        self.lagged = 0.0  #: [s] that the simulation fell behind, and was not caught up
        self._path: list[Array] = []
        arrays = topics.arrays([mount.name for mount in self.setup.skin.mounts])
        self._arrays = arrays if sensed else {}
        links = {name: self.setup.skin.mounts[rows[0]].link for name, rows in arrays.items()}
        self._frames = links
        self._scans = {
            name: self.create_publisher(SensorArray, topics.scan_topic(name), topics.RELIABLE_QOS)
            for name in self._arrays
        }
        if self._follows:
            self.create_subscription(
                JointState, topics.JOINT_STATES, self._take_joints, topics.NEWEST_QOS
            )
        else:
            self._joints = self.create_publisher(
                JointState, topics.JOINT_STATES, topics.RELIABLE_QOS
            )
            self.create_subscription(
                Float64MultiArray, topics.COMMANDS, self._take_command, topics.NEWEST_QOS
            )
        self.get_logger().info(
            f"{scenario.name}: {self.setup.robot.name} for {scenario.duration:g} s"
            + ("" if part == "all" else f", {part} only")
        )

    def run(self) -> None:
        """Until the scenario's duration is over, or the node is to end."""
        due = time.monotonic()
        while self._running():
            while self._running() and (left := due - time.monotonic()) > 0.0:
                self._executor.spin_once(timeout_sec=left)
            given = self._source.read()
            if given is None:
                return
            self._publish(given)
            self._path.append(given.q)
            self._source.command(self._velocity(given.q))
            due += self._period
            behind = time.monotonic() - due
            if behind > LONGEST_LAG:
                self.lagged += behind
                due += behind

    def summary(self) -> dict[str, float | int | str]:
        """What only the simulator knows: true distances, as in `summary.json`."""
        elapsed = np.arange(len(self._path)) * self._period
        asked = decisive_truth(
            self.setup.robot, self.setup.scene, elapsed, np.array(self._path),
            final_ticks(elapsed), under=TOO_CLOSE,
        )  # fmt: skip
        ends = np.minimum(asked.distance, NOTHING)[final_ticks(elapsed)]
        return {
            "scenario": self.setup.scenario.name,
            "ticks": len(self._path),
            "commands": self.commands,
            "lagged_s": self.lagged,
            "true_min_m": float(min(np.fmin.reduce(asked.distance, initial=np.inf), NOTHING)),
            "true_final_m": float(ends.mean()),
            "moved_rad": float(np.abs(np.diff(self._path, axis=0)).sum()),
        }

    def write(self, path: Path) -> None:
        """The summary as JSON."""
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(self.summary(), indent=2) + "\n", encoding="utf-8")

    def _velocity(self, q: Array) -> Array:
        """Of the arm until the next tick."""
        if self._follows:
            return np.zeros_like(q) if self._q is None else (self._q - q) / self._period
        alive = time.monotonic() - self._commanded <= COMMAND_LIFE
        return self._qd if alive else np.zeros_like(self._qd)

    def _publish(self, given: TickInput) -> None:
        now = int(self.get_clock().now().nanoseconds)
        stamps = [now - round((given.time - scan.stamp) * SECOND) for scan in given.scans]
        for name, scans in scan_messages(given.scans, self._arrays, stamps).items():
            head = header(now, self._frames[name])
            self._scans[name].publish(SensorArray(header=head, scans=scans))
        if not self._follows:
            head = header(now, "")
            self._joints.publish(joint_message(self._names, given.q, self._velocity(given.q), head))

    def _take_command(self, message: Float64MultiArray) -> None:
        qd = np.array(message.data, np.float64)
        if qd.shape != self._qd.shape or not np.isfinite(qd).all():
            self.get_logger().error(
                f"{topics.COMMANDS}: {len(qd)} values, {len(self._names)} finite ones are needed"
            )
            return
        self._qd, self._commanded = qd, time.monotonic()
        self.commands += 1

    def _take_joints(self, message: JointState) -> None:
        q = joint_positions(message, self._names)
        if q is not None:
            self._q = q

"""A scenario's robot, simulated in real time behind the topics of a real one.

The arm and its sensors are two processes, as they are two devices: however long the rays take, the
joint states come on time.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from proxcgal_msgs.msg import SensorArray
from rclpy.executors import Executor
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from proxcgal.evaluation.sparse_ground_truth import sparse_ground_truth
from proxcgal.evaluation.trial_log import NOTHING, TOO_CLOSE, final_ticks
from proxcgal.scenario.scenario import Scenario
from proxcgal.scenario.setup import Setup
from proxcgal.sim.source import SimulatedSource
from proxcgal.sim.world import Hits, World
from proxcgal_ros import topics
from proxcgal_ros.convert import (
    SECOND,
    header,
    joint_message,
    joint_positions,
    nanoseconds,
    scan_messages,
)
from proxcgal_ros.parameters import warn_unknown

Array = NDArray[np.float64]

COMMAND_LIFE = 0.1  # [s] without a command; then the arm rests, as a robot's driver makes it
LONGEST_LAG = 0.1  # [s] that is caught up; what is lost beyond stays lost
LONGEST_GAP = 10  # joint states that were lost in a row, and are filled in
MOVING = 1e-6  # [rad/s] or [m/s] of any joint: with it the scenario begins
ENDLESS = 1e9  # [s]


class SimulatedArm(Node):
    """Follows its velocity commands exactly; the scenario begins with the first that moves it."""

    def __init__(self, executor: Executor, running: Callable[[], bool], scenario: Scenario) -> None:
        """Loads the scenario. Raises: ProxError."""
        super().__init__("proxcgal_arm")
        self._executor, self._running = executor, running
        self.setup = Setup.of(scenario)
        self._names = list(self.setup.robot.joint_names)
        self._period = 1.0 / scenario.simulation.control_hz
        self._ticks = max(round(scenario.duration * scenario.simulation.control_hz), 1)
        self._q = self.setup.q0.copy()
        self._qd: Array = np.zeros(len(self._names))
        self._commanded = -np.inf
        self.commands = 0  #: that came
        self.lagged = 0.0  #: [s] that the simulation fell behind, and did not catch up
        self._path: list[Array] = []  # since the scenario has begun
        self._joints = self.create_publisher(JointState, topics.JOINT_STATES, topics.RELIABLE_QOS)
        self.create_subscription(
            Float64MultiArray, topics.COMMANDS, self._take_command, topics.NEWEST_QOS
        )
        warn_unknown(self)
        self.get_logger().info(
            f"{scenario.name}: {self.setup.robot.name}, for {scenario.duration:g} s once it moves"
        )

    def run(self) -> None:
        """Until the scenario is over, or the node is to end."""
        due = time.monotonic()
        while self._running() and len(self._path) < self._ticks:
            while self._running() and (left := due - time.monotonic()) > 0.0:
                self._executor.spin_once(timeout_sec=left)
            alive = time.monotonic() - self._commanded <= COMMAND_LIFE
            qd = self._qd if alive else np.zeros_like(self._qd)
            now = int(self.get_clock().now().nanoseconds)
            self._joints.publish(joint_message(self._names, self._q, qd, header(now, "")))
            if self._path or np.abs(qd).max() > MOVING:
                self._path.append(self._q)
            self._q = self._q + qd * self._period
            due += self._period
            behind = time.monotonic() - due
            if behind > LONGEST_LAG:
                self.lagged += behind
                due += behind

    def summary(self) -> dict[str, float | int | str]:
        """What only the simulator knows: true distances, as in `summary.json`."""
        elapsed = np.arange(len(self._path)) * self._period
        told: dict[str, float | int | str] = {
            "scenario": self.setup.scenario.name,
            "ticks": len(self._path),
            "commands": self.commands,
            "lagged_s": self.lagged,
        }
        if not self._path:
            return told
        asked = sparse_ground_truth(
            self.setup.robot, self.setup.scene, elapsed, np.array(self._path),
            final_ticks(elapsed), under=TOO_CLOSE,
        )  # fmt: skip
        ends = np.minimum(asked.distance, NOTHING)[final_ticks(elapsed)]
        return {
            **told,
            "true_min_m": float(min(np.fmin.reduce(asked.distance, initial=np.inf), NOTHING)),
            "true_final_m": float(ends.mean()),
        }

    def write(self, path: Path) -> None:
        """The summary as JSON."""
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(self.summary(), indent=2) + "\n", encoding="utf-8")

    def _take_command(self, message: Float64MultiArray) -> None:
        qd = np.array(message.data, np.float64)
        if qd.shape != self._qd.shape or not np.isfinite(qd).all():
            self.get_logger().error(
                f"{topics.COMMANDS}: {len(qd)} values; {len(self._names)} finite ones are needed"
            )
            return
        self._qd, self._commanded = qd, time.monotonic()
        self.commands += 1


class _Begun:
    """A world whose clock starts when the arm first moves."""

    def __init__(self, world: World) -> None:
        self._world = world
        self.begin = np.inf  # [s] on the source's clock

    def place(self, q: Array, time: float) -> None:
        self._world.place(q, max(time - self.begin, 0.0))

    def cast(self, origins_W: Array, directions_W: Array, start: float) -> Hits:
        return self._world.cast(origins_W, directions_W, start)


class SimulatedSensors(Node):
    """Ride on the arm that the joint states tell of, and measure where those were stamped."""

    def __init__(self, executor: Executor, running: Callable[[], bool], scenario: Scenario) -> None:
        """Loads the scenario. Raises: ProxError."""
        super().__init__("proxcgal_sensors")
        self._executor, self._running = executor, running
        setup = Setup.of(scenario)
        endless = scenario.model_copy(update={"duration": ENDLESS})  # who begins it, takes his time
        setup = replace(setup, scenario=endless)  # its people move for as long as the scenario is
        self._world = _Begun(World(setup.robot, setup.scene))
        self._source = SimulatedSource(setup, self._world, scenario.seed)  # type: ignore[arg-type]
        self._names = list(setup.robot.joint_names)
        self._period = 1.0 / scenario.simulation.control_hz
        self._q = setup.q0.copy()
        self._stamp_ns = 0
        self._arrays = topics.arrays([mount.name for mount in setup.skin.mounts])
        self._links = {name: setup.skin.mounts[rows[0]].link for name, rows in self._arrays.items()}
        self._scans = {
            name: self.create_publisher(SensorArray, topics.scan_topic(name), topics.RELIABLE_QOS)
            for name in self._arrays
        }
        self.create_subscription(
            JointState, topics.JOINT_STATES, self._take_joints, topics.SENSOR_QOS
        )
        self.get_logger().info(f"{scenario.name}: {len(setup.skin)} sensors")

    def run(self) -> None:
        """Until the node is to end."""
        while self._running():
            self._executor.spin_once(timeout_sec=0.1)

    def _take_joints(self, message: JointState) -> None:
        q = joint_positions(message, self._names)
        if q is None or not np.isfinite(q).all():
            return
        stamp = nanoseconds(message.header.stamp)
        if self._stamp_ns == 0:  # put where the arm stands: nothing was measured on the way there
            self._source.command((q - self._q) / self._period)
            self._source.read()
            self._source.read()
            self._q, self._stamp_ns = q, stamp
            return
        gap = (stamp - self._stamp_ns) / (self._period * SECOND)
        steps = min(max(round(gap), 1), LONGEST_GAP)
        self._stamp_ns = stamp
        qd = (q - self._q) / (steps * self._period)
        for step in range(steps):
            self._source.command(qd)
            inputs = self._source.read()
            assert inputs is not None
            if np.isinf(self._world.begin) and np.abs(qd).max() > MOVING:
                self._world.begin = inputs.time
            if inputs.scans:
                then = stamp - round((steps - 1 - step) * self._period * SECOND)
                stamps = [then - round((inputs.time - s.stamp) * SECOND) for s in inputs.scans]
                for name, scans in scan_messages(inputs.scans, self._arrays, stamps).items():
                    head = header(int(self.get_clock().now().nanoseconds), self._links[name])
                    self._scans[name].publish(SensorArray(header=head, scans=scans))
        self._q = q


@contextmanager
def sensors_beside(arguments: Sequence[str]) -> Iterator[None]:
    """The sensors in a process of their own, which ends with this one, however that ends."""
    command = [sys.executable, "-c", _CHILD, *arguments]
    child = subprocess.Popen(command, stdin=subprocess.PIPE)
    try:
        yield
    finally:
        child.terminate()
        try:
            child.wait(5.0)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()


#: Its standard input closes when the parent dies, even of SIGKILL.
_CHILD = """
import os, signal, sys, threading, warnings

def watch():
    while os.read(0, 1):
        pass
    os.kill(os.getpid(), signal.SIGTERM)

threading.Thread(target=watch, daemon=True).start()
warnings.simplefilter("ignore")  # the arm's process has told them
from proxcgal_ros.cli import main
sys.exit(main())
"""

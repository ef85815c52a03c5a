"""How long from a sensor message to the command that it brought, over ROS 2 on this machine.

This process sends joint states and scans and hears the commands; the node is another one. Printed:
median, 90 %, 99 % and worst, in milliseconds, and what was sent.

python bench/latency.py [SECONDS]
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import time

import numpy as np
import rclpy
from numpy.typing import NDArray
from proxcgal_msgs.msg import Proximity, SensorArray
from proxcgal_ros import topics
from proxcgal_ros.convert import header, joint_message, scan_messages
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from proxcgal import _core
from proxcgal.sim.scenario import load_scenario
from proxcgal.sim.setup import Setup

try:
    from rclpy.experimental import EventsExecutor as Executor
except ImportError:
    from rclpy.executors import SingleThreadedExecutor as Executor

HZ, SENSOR_EVERY = 100.0, 7  # 14.3 scans of each sensor a second
DOMAIN = "59"


class Bench(Node):
    """Sends what a robot would, and notes when commands come."""

    def __init__(self) -> None:
        super().__init__("bench")
        self._executor = Executor()
        self._executor.add_node(self)
        self.setup = Setup.of(load_scenario("front_plane"))
        self._names = list(self.setup.robot.joint_names)
        self._arrays = topics.arrays([mount.name for mount in self.setup.skin.mounts])
        self._random = np.random.default_rng(0)
        self._counter = 0
        self.commands: list[float] = []
        self.mode = -1
        self._joints = self.create_publisher(JointState, topics.JOINT_STATES, topics.RELIABLE_QOS)
        self._scans = {
            name: self.create_publisher(SensorArray, topics.scan_topic(name), topics.RELIABLE_QOS)
            for name in self._arrays
        }
        self.create_subscription(
            Float64MultiArray, topics.COMMANDS, lambda _: self.commands.append(time.monotonic()),
            topics.RELIABLE_QOS,
        )  # fmt: skip
        self.create_subscription(Proximity, topics.PROXIMITY, self._hear, 10)

    def _hear(self, message: Proximity) -> None:
        self.mode = message.mode

    def heard(self, until: float) -> float | None:
        """Listens without a pause, until a command has come or it is that late."""
        self.commands.clear()
        while not self.commands and time.monotonic() < until:
            self._executor.spin_once(timeout_sec=0.0)
        return self.commands[0] if self.commands else None

    def _now(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    def send_joints(self) -> None:
        q = self.setup.q0
        self._joints.publish(
            joint_message(self._names, q, np.zeros_like(q), header(self._now(), ""))
        )

    def made(self) -> dict[str, SensorArray]:
        """Every zone of every sensor sees something, 0.6 to 1.2 m away: a full cloud."""
        now, status = self._now(), np.full(64, 5, np.uint8)
        scans = [
            _core.Scan(row, self._counter, 0.0, self._random.uniform(0.6, 1.2, 64), status)
            for row in range(len(self.setup.skin))
        ]
        self._counter += 1
        told = scan_messages(scans, self._arrays, [now] * len(scans))
        return {
            name: SensorArray(header=header(now, ""), scans=some) for name, some in told.items()
        }

    def send_scans(self, made: dict[str, SensorArray]) -> None:
        for name, message in made.items():
            self._scans[name].publish(message)


def main() -> None:
    """Prints the table."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 20.0
    os.environ |= {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": DOMAIN}
    child = subprocess.Popen(
        [sys.executable, "-m", "proxcgal_ros", "node"], stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        rclpy.init()
        bench = Bench()
        together, alone, apart, waits = measure(bench, seconds)
    finally:
        child.terminate()
        child.wait(10.0)
    print(f"{platform.machine()}, {os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}")
    print(f"{'':52}{'median':>8}{'90 %':>8}{'99 %':>8}{'worst':>8}  [ms]")
    show("joint state -> command, no scans in between", alone)
    show("scans -> command, in the robot's cycle (1920 zones)", together)
    show("scans -> command, at any time in the cycle", apart)
    show("  of which waiting for the next joint state", waits)
    sys.stdout.flush()
    os._exit(0)  # nothing is left to put away


def measure(bench: Bench, seconds: float) -> tuple[list[float], ...]:
    """Delays [s]: scans in the cycle, joint states alone, scans at any time, their wait."""
    random = np.random.default_rng(1)
    together: list[float] = []
    alone: list[float] = []
    apart: list[float] = []
    waits: list[float] = []
    due, cycle, ready = time.monotonic(), 0, 0
    end = due + 30.0
    while time.monotonic() < end:
        due += 1.0 / HZ
        cycle += 1
        beat = cycle % SENSOR_EVERY == 0
        loose = beat and (cycle // SENSOR_EVERY) % 2 == 0
        made = bench.made() if beat else {}
        sent = None
        if loose:  # at any time before the joint state
            sleep_until(due - random.uniform(0.0, 1.0) / HZ)
            sent = time.monotonic()
            bench.send_scans(made)
        sleep_until(due)
        bench.heard(0.0)
        joints = time.monotonic()
        if beat and not loose:
            bench.send_scans(made)
        bench.send_joints()
        came = bench.heard(due + 0.8 / HZ)
        if bench.mode != 0 or came is None:
            continue
        ready += 1
        if ready == 100:  # warm
            end = time.monotonic() + seconds
        if ready <= 100:
            continue
        if sent is not None:
            apart.append(came - sent)
            waits.append(joints - sent)
        else:
            (together if beat else alone).append(came - joints)
    return together, alone, apart, waits


def sleep_until(due: float) -> None:
    """To the clock's resolution."""
    while (left := due - time.monotonic()) > 0.0:
        time.sleep(left)


def show(name: str, delays: list[float]) -> None:
    """A line of the table."""
    if not delays:
        print(f"{name:52}  nothing came")
        return
    values: NDArray[np.float64] = 1e3 * np.array(delays)
    shown = [np.median(values), *np.percentile(values, (90, 99)), values.max()]
    print(f"{name:52}" + "".join(f"{value:8.2f}" for value in shown) + f"  n = {len(values)}")


if __name__ == "__main__":
    main()

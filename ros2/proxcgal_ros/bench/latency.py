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
from proxcgal_ros.convert import header, joint_message, nanoseconds, scan_messages
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from proxcgal import _core
from proxcgal.scenario.loading import load_scenario
from proxcgal.scenario.setup import Setup

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
        self.commands: list[float] = []  # [s] of receipt
        self.stamps: list[int] = []  # of the joint state of each
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
        self.stamps.append(nanoseconds(message.header.stamp))

    def listen(self, until: float) -> None:
        """Without a pause: each message's time of receipt is noted."""
        while time.monotonic() < until:
            self._executor.spin_once(timeout_sec=0.0)

    def answer(self, stamp: int, since: float, until: float) -> float | None:
        """When the first command came that a joint state of this stamp brought, after `since`.

        A command's proximity follows it, in the same order, and has the joint state's stamp.
        """
        while time.monotonic() < until:
            self._executor.spin_once(timeout_sec=0.0)
            for command, told in zip(self.commands, self.stamps, strict=False):
                if told == stamp and command > since:
                    return command
        return None

    def forget(self) -> None:
        """What has been told until now."""
        told = min(len(self.commands), len(self.stamps))
        del self.commands[:told], self.stamps[:told]

    def _now(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    def send_joints(self) -> int:
        """Its stamp."""
        q, stamp = self.setup.q0, self._now()
        self._joints.publish(joint_message(self._names, q, np.zeros_like(q), header(stamp, "")))
        return stamp

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
        together, alone, apart = measure(bench, seconds)
    finally:
        child.terminate()
        child.wait(10.0)
    print(f"{platform.machine()}, {os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}")
    print(f"{'':52}{'median':>8}{'90 %':>8}{'99 %':>8}{'worst':>8}  [ms]")
    show("joint state -> command, no scans in between", alone)
    show("scans -> command, in the robot's cycle (1920 zones)", together)
    show("an array's scans -> command, at any time in between", apart)
    sys.stdout.flush()
    os._exit(0)  # nothing is left to put away


def measure(bench: Bench, seconds: float) -> tuple[list[float], ...]:
    """Delays [s]: all arrays' scans in the cycle, joint states alone, one array's in between."""
    random = np.random.default_rng(1)
    together: list[float] = []
    alone: list[float] = []
    apart: list[float] = []
    due, cycle, ready = time.monotonic(), 0, 0
    end = due + 30.0
    loose: dict[str, SensorArray] = {}  # of a beat: told one by one, in cycles of their own
    while time.monotonic() < end:
        due += 1.0 / HZ
        cycle += 1
        beat = cycle % SENSOR_EVERY == 0
        made = bench.made() if beat else {}
        if beat and (cycle // SENSOR_EVERY) % 2 == 0:
            loose, made = made, {}
        sleep_until(due)
        bench.forget()
        begun = time.monotonic()
        bench.send_scans(made)
        stamp = bench.send_joints()
        came = bench.answer(stamp, begun, due + 0.9 / HZ)
        if bench.mode == 0 and came is not None:
            ready += 1
            if ready == 100:  # warm
                end = time.monotonic() + seconds
            if ready > 100:
                (together if made else alone).append(came - begun)
        if not loose or came is None:
            continue
        # At any time until the next joint state, which may come before the answer and bring it.
        name = min(loose)
        one = {name: loose.pop(name)}
        bench.listen(due + random.uniform(0.0, 1.0) / HZ)
        sent = time.monotonic()
        bench.send_scans(one)
        came = bench.answer(stamp, sent, due + 1.0 / HZ)
        if came is None:
            due += 1.0 / HZ
            cycle += 1
            stamp = bench.send_joints()
            came = bench.answer(stamp, sent, due + 0.9 / HZ)
        if came is not None and bench.mode == 0 and ready > 100:
            apart.append(came - sent)
    return together, alone, apart


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

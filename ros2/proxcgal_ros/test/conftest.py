"""Real ROS 2 processes on this machine only; each test in a domain of its own."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import rclpy
from proxcgal_msgs.action import MoveRobot
from proxcgal_msgs.msg import GoalRefused, Proximity
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

# This machine only; and not by shared memory, which a process that is killed can leave locked.
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ["FASTDDS_BUILTIN_TRANSPORTS"] = "UDPv4"
with suppress(PermissionError):
    os.setpriority(os.PRIO_PROCESS, 0, -10)  # what it hears has times
LIFE = 900  # [s] after which a process ends by itself, whatever became of the test
PATIENCE = 120.0  # [s] for what has to come, however busy the machine is
_DOMAINS = 101  # of Linux, those whose ports are free: 0, everybody's, to 101
_domains = (1 + (os.getpid() + test) % _DOMAINS for test in itertools.count())


class Processes:
    """Started in process groups of their own; all of them are ended with the test."""

    def __init__(self, folder: Path, domain: int) -> None:
        self._folder = folder
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self.environment = {
            **os.environ,
            "ROS_DOMAIN_ID": str(domain),
            "ROS_LOG_DIR": str(folder / "log"),
            "PYTHONUNBUFFERED": "1",
        }

    def start(self, name: str, *arguments: str) -> subprocess.Popen[bytes]:
        """proxcgal_ros with these arguments; what it says goes to a file."""
        # A controller goes before other work on any robot; where that is not allowed it says so.
        command = ["nice", "-n", "-10", "timeout", "-k", "5", str(LIFE)]
        command += [sys.executable, "-m", "proxcgal_ros"]
        with (self._folder / f"{name}.log").open("wb") as log:
            process = subprocess.Popen(
                [*command, *arguments], env=self.environment, stdin=subprocess.DEVNULL,
                stdout=log, stderr=subprocess.STDOUT, start_new_session=True,
            )  # fmt: skip
        self._running[name] = process
        return process

    def said(self, name: str) -> str:
        return (self._folder / f"{name}.log").read_text(errors="replace")

    def kill(self, name: str) -> None:
        """As a crash ends it, at once."""
        process = self._running.pop(name)
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()

    def end(self, name: str, timeout: float = PATIENCE) -> int:
        """As Ctrl-C ends it; its exit code."""
        process = self._running.pop(name)
        with suppress(ProcessLookupError):  # it has ended by itself
            os.killpg(process.pid, signal.SIGINT)
        try:
            return process.wait(timeout)
        finally:
            _end_group(process)

    def end_all(self) -> None:
        for process in self._running.values():
            _end_group(process)
        self._running.clear()


def _end_group(process: subprocess.Popen[bytes]) -> None:
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


class Client:
    """This process as a client of the others: listens, sends goals."""

    def __init__(self, domain: int) -> None:
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = Node("client", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self.action = ActionClient(self.node, MoveRobot, "move_robot")
        self.feedback: list[MoveRobot.Feedback] = []
        self.heard: dict[str, list[tuple[float, Any]]] = {}

    def listen(self, kind: type, topic: str, *, latched: bool = False) -> list[tuple[float, Any]]:
        """What comes from now on, with the time of receipt [s]."""
        heard = self.heard.setdefault(topic, [])
        qos = QoSProfile(
            depth=100,
            reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        )
        self.node.create_subscription(
            kind, topic, lambda message: heard.append((time.monotonic(), message)), qos
        )
        return heard

    def until(self, what: Callable[[], object], timeout: float = PATIENCE) -> bool:
        """Spins until it is so; false where it never came to that."""
        end = time.monotonic() + timeout
        while not what():
            if time.monotonic() > end:
                return False
            self._executor.spin_once(timeout_sec=0.02)
        return True

    def ask(self, request: Any, kind: type, service: str) -> Any:
        """A service's answer."""
        client = self.node.create_client(kind, service)
        assert client.wait_for_service(PATIENCE)
        future = client.call_async(request)
        assert self.until(future.done), f"no answer from {service}"
        return future.result()

    def send(self, goal: MoveRobot.Goal) -> Any:
        """The goal's handle."""
        assert self.action.wait_for_server(PATIENCE)
        future = self.action.send_goal_async(
            goal, feedback_callback=lambda told: self.feedback.append(told.feedback)
        )
        assert self.until(future.done), "no answer to a goal"
        return future.result()

    def result(self, handle: Any) -> Any:
        """Its status and result."""
        future = handle.get_result_async()
        assert self.until(future.done), "the goal has not ended"
        return future.result()

    def moving(self, speed: float = 0.01) -> bool:
        """Waits until feedback tells that the tool is faster than that [m/s]."""
        self.feedback.clear()
        return self.until(lambda: self.feedback and self.feedback[-1].linvel_norm > speed)

    def cancel(self, handle: Any) -> int:
        """How many goals the server says it cancels."""
        future = handle.cancel_goal_async()
        assert self.until(future.done), "no answer to a cancel"
        return len(future.result().goals_canceling)

    def refusals(self) -> list[str]:
        """Listens for why goals are refused; gives the last one's reasons."""
        if "goal_refused" not in self.heard:
            self.listen(GoalRefused, "goal_refused", latched=True)
        return self.heard["goal_refused"][-1][1].reasons if self.heard["goal_refused"] else []

    def modes(self) -> list[tuple[float, Any]]:
        return self.heard.get("proximity") or self.listen(Proximity, "proximity")

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()


@pytest.fixture
def domain() -> int:
    return next(_domains)


@pytest.fixture
def processes(tmp_path: Path, domain: int, request: pytest.FixtureRequest) -> Iterator[Processes]:
    processes = Processes(tmp_path, domain)
    try:
        yield processes
    finally:
        processes.end_all()
        for log in sorted(tmp_path.glob("*.log")):
            request.node.add_report_section("call", log.stem, log.read_text(errors="replace"))


@pytest.fixture
def client(domain: int) -> Iterator[Client]:
    client = Client(domain)
    try:
        yield client
    finally:
        client.close()


def joint_bounds(hold: float, stop: float) -> tuple[str, ...]:
    """The node's arguments for other ages [s] of the joint state than 0.02 and 0.1."""
    keys = [
        f"'controller.monitor.joints_{k}_after={v}'" for k, v in (("hold", hold), ("stop", stop))
    ]
    return ("--ros-args", "-p", f"set:=[{', '.join(keys)}]")


#: For tests that are not about joint states: a busy machine stands still for longer than a robot's
#: may. The node's own bounds are 20 and 100 ms.
PATIENT = joint_bounds(2.0, 10.0)


def goal(x: float = 0.0, y: float = 0.0, z: float = 0.0, **fields: Any) -> MoveRobot.Goal:
    """Relative to the tool's frame, orientation kept, unless told otherwise."""
    fields = {"frame": "end_effector", "keep_orientation": True, **fields}
    request = MoveRobot.Goal(**fields)
    request.translation.x, request.translation.y, request.translation.z = x, y, z
    return request


def endless_goal() -> MoveRobot.Goal:
    """Above the arm of front_plane: no farther than all its lengths, and in no posture's reach.

    The tool is on its way for 5 s and more, and the goal lasts until its timeout, or something
    else, ends it.
    """
    return goal(0.0, 0.0, 1.85, frame="kuka_base")

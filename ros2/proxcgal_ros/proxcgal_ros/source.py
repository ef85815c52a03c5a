"""Where the node's ticks come from: messages, and a watchdog where none come."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from proxcgal_msgs.msg import SensorArray
from rclpy.executors import Executor
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from proxcgal import _core
from proxcgal.scenario.setup import Setup
from proxcgal.sim.tick import TickInput
from proxcgal_ros import topics
from proxcgal_ros.clocks import Clocks
from proxcgal_ros.convert import (
    command_message,
    joint_positions,
    joint_velocities,
    nanoseconds,
    scans_of,
)
from proxcgal_ros.live_goals import LiveGoals
from proxcgal_ros.restarts import Restarts

Array = NDArray[np.float64]

JITTER = 0.25  # of a period: a joint state may come that much early and still make a tick
OVERDUE = 1.5  # periods without a joint state, after which the watchdog makes the tick
STEADY = 10  # joint states in a row that were not stale, before the first tick
BACKLOG = 50  # events that are looked through for one
SOON = 0.15  # of a period, on both sides: scans wait for a joint state that is expected then
EARLY_TICKS = 2  # for each array between two joint states; more scans wait for the next one
STILL = 1e-4  # [rad] or [m] of any joint
PATIENCE = 5.0  # [s]
KEPT_SCANS = 4  # of each sensor between two ticks; more are an attack or a fault


class RosSource:
    """Every joint state makes a tick, at the controller's rate; commands go out at once.

    Scans that come between two joint states make a tick too, with the last joint state carried on
    by its own velocity: what they see is acted on before the next one. Its stamp stays that of the
    measurement, and the controller lets velocities change by the time that has passed. Where no
    joint state comes the watchdog makes the ticks, so that the monitor finds it stale.
    """

    def __init__(
        self, node: Node, executor: Executor, setup: Setup, clocks: Clocks, goals: LiveGoals,
        running: Callable[[], bool],
    ) -> None:  # fmt: skip
        """Subscribes and publishes.

        Args:
            node: whose the topics are.
            executor: that it is spun by.
            setup: robot and skin.
            clocks: ROS time to the controller's.
            goals: gives each tick its goal.
            running: false once the node is to end.
        """
        self._node, self._executor, self._running = node, executor, running
        self._clocks, self._goals = clocks, goals
        self._names = list(setup.robot.joint_names)
        self._period = 1.0 / setup.scenario.simulation.control_hz
        self._scans: deque[_core.Scan] = deque(maxlen=KEPT_SCANS * max(len(setup.skin), 1))
        self._restarts = Restarts(setup.scenario.controller.monitor.hold_after)
        self._q: Array | None = None
        self._v: Array = np.zeros(len(self._names))  # measured, as far as it is told
        self._fastest = np.asarray(setup.robot.qd_max)
        self._q_stamp = -np.inf
        self._received = -np.inf
        self._steady = 0
        self._stale = setup.scenario.controller.monitor.joints_hold_after
        self.q_stamp_ns = 0  #: of the last joint state, ROS time
        #: of the newest scan of each array that a tick was given, ROS time
        self.scan_stamps_ns: dict[str, int] = {}
        self.qd: Array = np.zeros(len(self._names))  #: last command
        self._newest_ns: dict[str, int] = {}
        self._fresh = False  # a joint state that no tick of its own has been given
        self._seen = False  # scans that no tick has been given
        self._early = 0  # ticks since the last joint state's
        self._late = False  # was that one?
        self._due = -np.inf
        self._last = -np.inf  # tick of a joint state or of the watchdog
        self._warned = False
        node.create_subscription(
            JointState, topics.JOINT_STATES, self._take_joints, topics.NEWEST_QOS
        )
        arrays = topics.arrays([mount.name for mount in setup.skin.mounts])
        self._sensors = len(setup.skin)
        self._most_early = EARLY_TICKS * len(arrays)
        for name, rows in arrays.items():
            node.create_subscription(
                SensorArray, topics.scan_topic(name), self._taker(name, rows), topics.SENSOR_QOS
            )
        self._commands = node.create_publisher(
            Float64MultiArray, topics.COMMANDS, topics.RELIABLE_QOS
        )
        node.create_timer(self._period / 2.0, self._watch)
        self._overdue = False

    def read(self) -> TickInput | None:
        """The next tick's inputs, as soon as it is due; None once the node is to end."""
        while self._running():
            self._executor.spin_once(timeout_sec=SOON * self._period if self._seen else 0.1)
            if self._q is None or self._steady < STEADY:
                continue
            if self._overdue:
                self._catch_up()
            if self._due_now():
                return self._input(self._clocks.now())
            if self._seen and self._may_be_early():
                return self._between()
        return None

    def standing(self, count: int) -> tuple[Array | None, list[_core.Scan]]:
        """Where the arm stands (n_q,), before the first tick, and scans from there.

        Args:
            count: of each sensor; of those that tell less in `PATIENCE`, what there is.

        Returns:
            None and none where the node is to end.
        """
        q: Array | None = None
        kept: list[_core.Scan] = []
        while self._running():
            self._executor.spin_once(timeout_sec=0.1)
            if self._q is None:
                continue
            if q is None or np.abs(self._q - q).max() > STILL:
                q, kept, end = self._q, [], self._clocks.now() + PATIENCE
            else:
                kept += self._scans
            self._scans.clear()
            told = Counter(scan.sensor for scan in kept)
            enough = all(told[row] >= count for row in range(self._sensors))
            if enough or self._clocks.now() > end:
                self._steady, self._seen = 0, False
                return q, kept
        return None, []

    def command(self, qd: Array) -> None:
        """Joint velocities (n_q,) until the next tick."""
        self.qd = qd
        self._commands.publish(command_message(qd))

    def stop(self) -> None:
        """The last command: at rest."""
        self.command(np.zeros(len(self._names)))

    def _due_now(self) -> bool:
        early = self._clocks.now() < self._due - JITTER * self._period
        return self._overdue or (self._fresh and not early)

    def _input(self, now: float) -> TickInput:
        """Of a joint state's tick, or the watchdog's."""
        assert self._q is not None
        self._late = now - self._last > 2.0 * self._period and self._fresh and self._last > -np.inf
        self._due = max(self._due + self._period, now + (1.0 - JITTER) * self._period)
        self._last, self._fresh, self._overdue, self._early = now, False, False, 0
        return self._given(now, self._q)

    def _may_be_early(self) -> bool:
        """Not where joint states stay away, and not where they were late: those are counted.

        Nor where the last is stale by now, though its own tick was in time: the next may be due.
        """
        now = self._clocks.now()
        fresh = now - self._q_stamp < min(OVERDUE * self._period, self._stale)
        soon = abs(self._received + self._period - now) < SOON * self._period
        return fresh and not soon and not self._late and self._early < self._most_early

    def _between(self) -> TickInput:
        """Of a tick between joint states; scans that are here already go with it."""
        for _ in range(self._most_early):
            self._executor.spin_once(timeout_sec=0.0)
            if self._due_now():
                return self._input(self._clocks.now())
        now = self._clocks.now()
        assert self._q is not None
        self._early += 1
        if self._fresh:  # it has come too early for a tick of its own, which is given the same
            return self._given(now, self._q)
        ahead = min(max(now - self._q_stamp, 0.0), OVERDUE * self._period)
        return self._given(now, self._q + ahead * self._v)

    def _given(self, now: float, q: Array) -> TickInput:
        scans, self._scans = tuple(self._scans), deque(maxlen=self._scans.maxlen)
        self.scan_stamps_ns = dict(self._newest_ns)
        self._seen = False
        goal = self._goals.at(now, q)
        return TickInput(now, q, goal, scans, late=self._late, q_stamp=self._q_stamp)

    def _take_joints(self, message: JointState) -> None:
        q = joint_positions(message, self._names)
        if q is None:
            if not self._warned:
                self._warned = True
                self._node.get_logger().warning(
                    f"{topics.JOINT_STATES}: a message without some of {', '.join(self._names)}; "
                    "such messages are left alone"
                )
            return
        self.q_stamp_ns = nanoseconds(message.header.stamp) or self._clocks.now_ns()
        stamp = self._clocks.carried(self.q_stamp_ns)
        self._received = self._clocks.now()
        if self._steady < STEADY:  # while a driver starts nothing is latched
            self._steady = self._steady + 1 if stamp - self._q_stamp < self._stale else 0
        self._q, self._q_stamp = q, stamp
        self._v = joint_velocities(message, self._names, self._fastest)
        self._fresh = True

    def _taker(self, name: str, rows: list[int]) -> Callable[[SensorArray], None]:
        def take(message: SensorArray) -> None:
            now = self._clocks.now()
            self._scans.extend(scans_of(message, rows, self._clocks.carried, now, self._restarts))
            stamps = [nanoseconds(scan.stamp) for scan in message.scans[: len(rows)]]
            self._newest_ns[name] = max([self._newest_ns.get(name, 0), *stamps])
            self._seen = True

        return take

    def _watch(self) -> None:
        """Makes a tick due where joint states stay away."""
        self._overdue = self._clocks.now() - self._last > OVERDUE * self._period

    def _catch_up(self) -> None:
        """Perhaps it was this process that stood still: what has come meanwhile goes first."""
        for _ in range(BACKLOG):
            if self._fresh:
                return
            self._executor.spin_once(timeout_sec=0.0)

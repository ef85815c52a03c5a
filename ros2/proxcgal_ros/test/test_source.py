"""When the node makes ticks, over scripted messages and their times of receipt."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from proxcgal_msgs.msg import SensorArray
from proxcgal_ros.convert import SECOND, header, joint_message
from proxcgal_ros.source import RosSource
from sensor_msgs.msg import JointState

from proxcgal.scenario.loading import load_scenario
from proxcgal.scenario.setup import Setup
from proxcgal.sim.tick import TickInput


class Script:
    """Node, executor and clock in one: each message comes at its time, timers at theirs."""

    def __init__(self, hz: float, travel: float, scans_after: float) -> None:
        """One second of joint states.

        Args:
            hz: of joint states and ticks.
            travel: from a joint state's stamp to its receipt [s].
            scans_after: from each receipt to an array's message [s].
        """
        scenario = load_scenario("front_plane", [f"simulation.control_hz={hz}"])
        self.setup = Setup.of(scenario)
        self.time, self._travel, self._until = 1.0, travel, 2.0
        self.callbacks: dict[type, Callable[[Any], None]] = {}
        self.timer: tuple[float, Callable[[], None]] | None = None
        self.next_timer = np.inf
        self.events = sorted(
            (1.0 + i / hz + after, kind)
            for i in range(round(hz))
            for after, kind in ((0.0, "joints"), (scans_after, "scans"))
        )

    # As a node.
    def create_subscription(self, kind: type, _: str, take: Callable[[Any], None], __: Any) -> None:
        self.callbacks[kind] = take

    def create_publisher(self, *_: Any) -> Any:
        return SimpleNamespace(publish=lambda message: None)

    def create_timer(self, period: float, call: Callable[[], None]) -> None:
        self.timer, self.next_timer = (period, call), self.time + period

    # As the clocks.
    def now(self) -> float:
        return self.time

    def carried(self, stamp_ns: int) -> float:
        return stamp_ns / SECOND

    # As the executor: one message or timer, or the time is over.
    def spin_once(self, timeout_sec: float) -> None:
        assert self.timer is not None
        due = min(self.events[0][0] if self.events else np.inf, self.next_timer)
        if due > self.time + timeout_sec:
            self.time += timeout_sec
            return
        self.time = max(self.time, due)
        if due == self.next_timer:
            self.next_timer += self.timer[0]
            self.timer[1]()
            return
        _, kind = self.events.pop(0)
        if kind == "scans":
            self.callbacks[SensorArray](SensorArray())
            return
        q = self.setup.q0
        head = header(round((self.time - self._travel) * SECOND), "")
        names = list(self.setup.robot.joint_names)
        self.callbacks[JointState](joint_message(names, q, np.full_like(q, 0.1), head))

    def ticks(self) -> list[TickInput]:
        goal = np.array(self.setup.robot.tool_pose(self.setup.q0))
        source = RosSource(
            self, self, self.setup, self, SimpleNamespace(at=lambda time, q: goal),  # type: ignore[arg-type]
            lambda: self.time < self._until,
        )  # fmt: skip
        found = []
        while (inputs := source.read()) is not None:
            found.append(inputs)
        return found


def test_scans_between_joint_states_make_a_tick_with_the_arm_carried_on() -> None:
    script = Script(hz=100.0, travel=0.002, scans_after=0.004)
    early = [tick for tick in script.ticks() if tick.time - tick.q_stamp > 0.005]
    assert len(early) > 80
    for tick in early:
        assert tick.time - tick.q_stamp == pytest.approx(0.006, abs=1e-6)
        carried = script.setup.q0 + 0.1 * (tick.time - tick.q_stamp)
        np.testing.assert_allclose(tick.q, carried, atol=1e-9)


@pytest.mark.parametrize("hz", [55.0, 60.0, 70.0, 100.0])
def test_no_tick_comes_early_with_a_joint_state_that_is_stale_by_then(hz: float) -> None:
    stale = 0.02  # joints_hold_after; each joint state's own tick comes well before
    for share in (0.3, 0.5, 0.7, 0.8):
        script = Script(hz, travel=0.007, scans_after=share / hz)
        assert script.setup.scenario.controller.monitor.joints_hold_after == stale
        ticks = script.ticks()
        assert len(ticks) > 0.7 * hz
        assert max(tick.time - tick.q_stamp for tick in ticks) <= stale, share

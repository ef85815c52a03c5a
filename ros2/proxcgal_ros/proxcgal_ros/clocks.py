"""ROS time and the controller's clock."""

from __future__ import annotations

import time

from rclpy.node import Node

from proxcgal_ros.convert import SECOND

FARTHEST = 10 * SECOND  # [ns] a stamp that is farther off is of another clock


class Clocks:
    """The controller's clock is monotonic; stamps are carried over to it by their age.

    So a system clock that is set an hour on or back changes nothing. With `use_sim_time` the
    simulator's clock is the controller's.
    """

    def __init__(self, node: Node) -> None:
        """Args: whose ROS clock stamps are of."""
        self._node = node
        self._simulated = bool(node.get_parameter("use_sim_time").value)

    def now(self) -> float:
        """[s] on the controller's clock."""
        return self.now_ns() / SECOND if self._simulated else time.monotonic()

    def now_ns(self) -> int:
        """[ns] of ROS time."""
        return int(self._node.get_clock().now().nanoseconds)

    def carried(self, stamp_ns: int) -> float:
        """[s] on the controller's clock; a stamp that was left out is now."""
        if stamp_ns == 0:
            return self.now()
        age = self.now_ns() - stamp_ns
        return self.now() - min(max(age, -FARTHEST), FARTHEST) / SECOND

"""The simulated 12-joint robot of the thesis behind MoveRobot."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rclpy.executors import Executor
from rclpy.node import Node
from sensor_msgs.msg import JointState

from proxcgal.server.goals import GoalFeedback, GoalResult, JointGoal
from proxcgal.server.joint_server import JointRobotServer
from proxcgal_ros import topics
from proxcgal_ros.action import MoveRobotAction
from proxcgal_ros.convert import header, joint_message
from proxcgal_ros.parameters import warn_unknown

JOINTS_HZ = 50.0


class JointGoals:
    """`JointRobotServer` as the action takes it."""

    def __init__(self, server: JointRobotServer) -> None:
        """Args: who pursues the goals."""
        self._server = server

    def send_goal(self, goal: JointGoal) -> int:
        """Its number. Raises: GoalRefusedError."""
        return self._server.send_goal(goal)

    def cancel(self, number: int) -> bool:
        """False where it has ended already."""
        return self._server.cancel(number)

    def feedback(self, number: int) -> GoalFeedback | None:
        """None where it is not pursued."""
        told = self._server.feedback()
        return told if told is not None and told.goal == number else None

    def result(self, number: int) -> GoalResult | None:
        """None while it has not ended."""
        return self._server.result(number)


class JointNode(Node):
    """The action server, and where the arm stands."""

    def __init__(
        self, executor: Executor, running: Callable[[], bool], scenario: str,
        changes: Sequence[str], second: str,
    ) -> None:  # fmt: skip
        """Loads the scenario. Raises: ProxError.

        Args:
            executor: that it is spun by.
            running: false once it is to end.
            scenario: of kind joint, by name or path.
            changes: `key=value` on it.
            second: what a goal does while another is pursued, preempt or refuse.
        """
        super().__init__("proxcgal_joint")
        self._executor, self._running = executor, running
        self._server = JointRobotServer(scenario, changes, second=second)
        self._names = list(self._server.robot.joint_names)
        self._joints = self.create_publisher(JointState, topics.JOINT_STATES, topics.RELIABLE_QOS)
        self.create_timer(1.0 / JOINTS_HZ, self._tell)
        self._action = MoveRobotAction(self, JointGoals(self._server))
        warn_unknown(self)
        self.get_logger().info(f"{scenario}: {self._server.robot.name} takes goals")

    def run(self) -> None:
        """Until the node is to end."""
        with self._server:
            self._server.start()
            while self._running():
                self._executor.spin_once(timeout_sec=0.1)
        self._action.poll()
        self._executor.spin_once(timeout_sec=0.1)

    def _tell(self) -> None:
        now = int(self.get_clock().now().nanoseconds)
        q, qd = self._server.q, self._server.qd
        self._joints.publish(joint_message(self._names, q, qd, header(now, "")))

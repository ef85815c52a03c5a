"""The action MoveRobot in front of whoever pursues its goals."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from proxcgal_msgs.action import MoveRobot
from proxcgal_msgs.msg import GoalRefused
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future

from proxcgal.server.goals import BASE, GoalRefusedError, GoalResult, JointGoal
from proxcgal_ros import topics
from proxcgal_ros.convert import header
from proxcgal_ros.goals import GoalServer


@dataclass(slots=True)
class _Pursued:
    handle: ServerGoalHandle
    number: int
    ended: Future = field(default_factory=Future)


#: Fields of the goal that the action has other names for.
_NAMES = {"init": "init_config_name", "rpy": "rotation"}


def _in_ros(reason: str) -> str:
    """A reason with the action's names of what it is about."""
    return re.sub(r"^(init|rpy) =", lambda found: f"{_NAMES[found[1]]} =", reason)


class MoveRobotAction:
    """Takes goals in, tells how they are doing, and gives each its one terminal state.

    ROS 2 allows `canceled` only where a client asked for it: a goal that another preempted ends as
    aborted, and its result says `cancelled`, with the reason.
    """

    def __init__(
        self, node: Node, server: GoalServer, *, feedback_hz: float = 10.0, poll_hz: float = 50.0
    ) -> None:
        """Args: feedback and ends are looked for at these rates, on the node's executor."""
        self._node = node
        self._server = server
        self._numbers: dict[int, int] = {}  # of goals not yet accepted, by their request
        self._pursued: dict[int, _Pursued] = {}
        keep = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._refused = node.create_publisher(GoalRefused, topics.GOAL_REFUSED, keep)
        self._every = max(round(poll_hz / feedback_hz), 1)
        self._polls = 0
        self._timer = node.create_timer(1.0 / poll_hz, self.poll)
        self._action = ActionServer(
            node, MoveRobot, topics.ACTION, self._execute,
            goal_callback=self._asked, handle_accepted_callback=self._accepted,
            cancel_callback=self._cancel,
        )  # fmt: skip

    def poll(self) -> None:
        """Tells feedback, and the ends that have come."""
        self._polls += 1
        for pursued in list(self._pursued.values()):
            result = self._server.result(pursued.number)
            if result is not None:
                del self._pursued[pursued.number]
                pursued.ended.set_result(result)
            elif self._polls % self._every == 0:
                self._tell(pursued)

    def _asked(self, request: MoveRobot.Goal) -> GoalResponse:
        turn = request.rotation
        rpy = None if request.keep_orientation else (turn.roll, turn.pitch, turn.yaw)
        place = request.translation
        goal = JointGoal(
            translation=(place.x, place.y, place.z), rpy=rpy, frame=request.frame or BASE,
            init=request.init_config_name,
        )  # fmt: skip
        try:
            self._numbers[id(request)] = self._server.send_goal(goal)
        except GoalRefusedError as refusal:
            reasons = [_in_ros(reason) for reason in str(refusal).splitlines()]
            for reason in reasons:
                self._node.get_logger().warning(f"goal refused: {reason}")
            now = self._node.get_clock().now().nanoseconds
            self._refused.publish(
                GoalRefused(
                    header=header(now, ""),
                    reasons=reasons,
                    frame=request.frame,
                    translation=place,
                )
            )
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _accepted(self, handle: ServerGoalHandle) -> None:
        number = self._numbers.pop(id(handle.request))
        self._pursued[number] = _Pursued(handle, number)
        handle.execute()

    def _cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        for pursued in self._pursued.values():
            if pursued.handle.goal_id == handle.goal_id and self._server.cancel(pursued.number):
                return CancelResponse.ACCEPT
        return CancelResponse.REJECT

    async def _execute(self, handle: ServerGoalHandle) -> MoveRobot.Result:
        pursued = next(
            one for one in self._pursued.values() if one.handle.goal_id == handle.goal_id
        )
        result: GoalResult = await pursued.ended
        if result.outcome == "succeeded":
            handle.succeed()
        elif result.outcome == "cancelled" and handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        self._node.get_logger().info(f"goal {pursued.number} {result.outcome}: {result.reason}")
        return MoveRobot.Result(
            result=result.outcome, reason=result.reason, time=result.time_s,
            position_error=result.position_error_m, angle_error=result.angle_error_rad,
        )  # fmt: skip

    def _tell(self, pursued: _Pursued) -> None:
        feedback = self._server.feedback(pursued.number)
        if feedback is not None and pursued.handle.is_active:
            pursued.handle.publish_feedback(
                MoveRobot.Feedback(
                    state=feedback.state, time=feedback.time_s, linvel_norm=feedback.linvel_norm,
                    angvel_norm=feedback.angvel_norm, position_error=feedback.position_error_m,
                    angle_error=feedback.angle_error_rad,
                )
            )  # fmt: skip

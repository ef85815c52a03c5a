"""MoveRobot of the node, asked by another process."""

from __future__ import annotations

import pytest
from action_msgs.msg import GoalStatus
from proxcgal_msgs.msg import Proximity

from conftest import PATIENT, Client, Processes, endless_goal, goal
from proxcgal.scenario.loading import load_scenario
from proxcgal.scenario.setup import Setup


@pytest.fixture
def arm(processes: Processes, client: Client) -> Client:
    """A client of a node that controls a simulated arm, which runs."""
    processes.start("node", "node", *PATIENT, "-p", "goal_timeout:=3600.0")
    processes.start("sim", "sim", "front_plane", "--set", "duration=1000.0")
    heard = client.listen(Proximity, "proximity")
    running = client.until(lambda: heard and heard[-1][1].mode == Proximity.RUN)
    assert running, processes.said("node")
    return client


def test_goals_are_followed_cancelled_preempted_and_refused(
    arm: Client, processes: Processes
) -> None:
    # Followed: the tool arrives.
    handle = arm.send(goal(z=0.05))
    assert handle.accepted
    ended = arm.result(handle)
    assert ended.status == GoalStatus.STATUS_SUCCEEDED, ended.result
    assert (ended.result.result, ended.result.position_error < 0.03) == ("succeeded", True)

    # Cancelled: feedback tells how it goes; it ends once the arm rests.
    handle = arm.send(endless_goal())
    assert arm.moving()
    errors = [told.position_error for told in arm.feedback]
    assert arm.until(lambda: arm.feedback[-1].position_error < errors[0] - 0.05)
    assert arm.feedback[-1].state == "executing"
    assert arm.cancel(handle) == 1
    ended = arm.result(handle)
    assert ended.status == GoalStatus.STATUS_CANCELED
    assert (ended.result.result, ended.result.reason) == ("cancelled", "cancelled by the client")
    assert arm.cancel(handle) == 0

    # Preempted: the first ends, the second goes on to its own end, back where all began.
    setup = Setup.of(load_scenario("front_plane"))
    x, y, z = setup.robot.tool_pose(setup.q0)[:3, 3].tolist()
    first = arm.send(endless_goal())
    assert arm.moving()
    second = arm.send(goal(x, y, z, frame="kuka_base"))
    ended = arm.result(first)
    assert ended.status == GoalStatus.STATUS_ABORTED
    assert ended.result.result == "cancelled"
    assert "preempted by goal 4" in ended.result.reason
    assert arm.result(second).status == GoalStatus.STATUS_SUCCEEDED

    # Refused: each with its reason, and nothing has moved.
    arm.refusals()
    for bad, reason in (
        (goal(x=float("nan")), "must be finite"),
        (goal(x=9.0), "no posture reaches beyond"),
        (goal(frame="moon"), "must be one of kuka_base, base_link, end_effector"),
        (goal(init_config_name="free"), "a real arm is not put anywhere"),
    ):
        assert not arm.send(bad).accepted
        assert arm.until(lambda reason=reason: any(reason in r for r in arm.refusals()))

    # All that a goal may say at once is told at once.
    assert not arm.send(goal(y=float("inf"), frame="moon")).accepted
    assert arm.until(lambda: len(arm.refusals()) == 2)
    assert processes.end("node") == 0
    assert "Traceback" not in processes.said("node")

"""The 12-joint robot's goals, sent by another process."""

from __future__ import annotations

import importlib.util

import pytest
from action_msgs.msg import GoalStatus

from conftest import Client, Processes, goal

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("proxcgal.server.joint_server") is None,
    reason="proxcgal has no 12-joint action server",
)


def test_the_12_joint_robot_takes_goals_from_its_configurations(
    processes: Processes, client: Client
) -> None:
    # Slowly: each way takes long enough to be told of, and to be broken off.
    processes.start("joint", "joint", "joint_free", "--set", "controller.max_linear=0.1")
    client.refusals()

    # The thesis's own goal, from a named configuration; another one preempts it.
    first = client.send(goal(3.0, 0.291, 1.05, frame="kuka_base", init_config_name="free"))
    assert first.accepted, processes.said("joint")
    assert client.moving(0.05)
    second = client.send(goal(3.0, 0.2, 1.05, frame="kuka_base", init_config_name="jl"))
    ended = client.result(first)
    assert (ended.result.result, ended.status) == ("cancelled", GoalStatus.STATUS_ABORTED)
    assert "preempted by goal 2" in ended.result.reason
    assert client.moving(0.05)
    assert client.cancel(second) == 1
    ended = client.result(second)
    assert (ended.result.result, ended.status) == ("cancelled", GoalStatus.STATUS_CANCELED)

    # mob_mob violates the limit of its second joint.
    for bad, reason in (
        (goal(3.0, 0.2, 1.0, frame="kuka_base", init_config_name="mob_mob"), "mob_mob"),
        (goal(3.0, 0.2, 1.0, frame="kuka_base", init_config_name="nowhere"), "there are"),
        (goal(30.0, frame="kuka_base"), "no posture reaches beyond"),
    ):
        assert not client.send(bad).accepted
        assert client.until(lambda reason=reason: any(reason in r for r in client.refusals()))

    # A short way is gone to its end.
    ended = client.result(client.send(goal(z=0.1, init_config_name="free")))
    assert (ended.result.result, ended.status) == ("succeeded", GoalStatus.STATUS_SUCCEEDED)
    assert ended.result.position_error <= 0.03
    assert processes.end("joint") == 0
    assert "Traceback" not in processes.said("joint")

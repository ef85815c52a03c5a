"""Names of topics and frames, and what is published how."""

from __future__ import annotations

import re
from collections.abc import Sequence

from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

from proxcgal.models.robots import Robot

JOINT_STATES = "joint_states"
SCANS = "scans"  # and below it one topic for each array
COMMANDS = "velocity_controller/commands"  # as ros2_control's velocity controllers take
GOAL = "goal"
CLOUD = "cloud"
PROXIMITY = "proximity"
MARKERS = "markers"
DIAGNOSTICS = "/diagnostics"
ACTION = "move_robot"
GOAL_REFUSED = "goal_refused"
SCENARIO = "scenario"  # in bags: what the controller was set up with

#: Of inputs: whatever the publisher offers, and old ones are worth nothing.
SENSOR_QOS = QoSProfile(
    depth=10, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.BEST_EFFORT
)
NEWEST_QOS = QoSProfile(
    depth=1, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.BEST_EFFORT
)
#: Of outputs: both kinds of subscribers may listen.
RELIABLE_QOS = QoSProfile(
    depth=10, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.RELIABLE
)


def arrays(mount_names: Sequence[str]) -> dict[str, list[int]]:
    """The skin's rows of each array's sensors: those named alike up to the last `/`."""
    rows: dict[str, list[int]] = {}
    for row, name in enumerate(mount_names):
        rows.setdefault(name.rpartition("/")[0] or name, []).append(row)
    return rows


def scan_topic(array: str) -> str:
    """The topic of an array: its name, with what ROS 2 allows in names of topics."""
    parts = [re.sub(r"\W", "_", part, flags=re.ASCII) for part in array.split("/")]
    return "/".join([SCANS, *(f"_{part}" if part[:1].isdigit() else part for part in parts)])


def base_frame(robot: Robot) -> str:
    """The robot's base, W = B: the description's own name for it."""
    names = [
        frame.name
        for frame in robot.description.frames
        if frame.joint < 0 and (abs(frame.T_JF - _HERE) < 1e-9).all()
    ]
    links = [name for name in names if name.endswith("base_link")]
    return (links or names or ["base_link"])[0]


_HERE = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]

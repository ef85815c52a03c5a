"""Fuzz target: xacros, from file to what is known of the robot.

Each is expanded in a process of its own, so that a few a second are tried.
"""

from __future__ import annotations

import pinocchio  # noqa: F401  loaded here: imports are no part of what a call may take
from bounds import promises
from places import folder

from proxcgal.models.robots import describe_robot


def once(data: bytes) -> None:
    """Reads a robot from these bytes; raises where a promise is broken."""
    path = folder() / "robot.xacro"
    path.write_bytes(data)
    with promises():
        describe_robot(path)

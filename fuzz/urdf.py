"""Fuzz target: robot descriptions, URDF or MJCF by their outermost tag, from file to robot.

MJCF is compiled in a process of its own: what a fuzzer counts there is what comes before and after.
"""

from __future__ import annotations

import functools

import pinocchio  # noqa: F401  loaded here: imports are no part of what a call may take
from bounds import promises
from places import folder

from proxcgal.models.robots import describe_robot, load_robot

_TRIANGLE = b"""OFF
3 1 0
0 0 0
0.1 0 0
0 0.1 0
3 0 1 2
"""


@functools.cache
def _mesh() -> None:
    """A mesh beside the description, `part.off`."""
    (folder() / "part.off").write_bytes(_TRIANGLE)


def once(data: bytes) -> None:
    """Loads a robot from these bytes; raises where a promise is broken."""
    _mesh()
    path = folder() / "robot.xml"
    path.write_bytes(data)
    with promises():
        description = describe_robot(path)
        end = description.frames[-1].name
        robot = load_robot(path, vertices_per_link=None, speed_limits=1.0, tool=end)
        robot.link_poses([0.0] * robot.n_q)

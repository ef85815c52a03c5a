"""Two arms of one chain: the macro arm carries the micro arm, and what each does."""

import numpy as np

from proxcgal import _core
from proxcgal.core.errors import ConfigError
from proxcgal.core.typing import Array
from proxcgal.models.robots import Robot, once_per_robot
from proxcgal.models.surfaces import Surfaces, cached_pairs, random_postures

_POSTURES = 4000
_SAMPLES, _FEW_JOINTS = 1000, 3


def part(robot: Robot, macro_joints: int, arm: str) -> tuple[int, int]:
    """First joint and number of joints of the `macro` or the `micro` arm.

    Raises:
        ConfigError: the robot has no two such arms.
    """
    if not 0 < macro_joints < robot.n_q:
        raise ConfigError(
            f"controller.macro_joints = {macro_joints}: {robot.name} has {robot.n_q} joints, so "
            f"between 1 and {robot.n_q - 1} are those of the arm that carries the other"
        )
    return (0, macro_joints) if arm == "macro" else (macro_joints, robot.n_q - macro_joints)


def watched_pairs(robot: Robot, macro_joints: int, d_min: float) -> list[tuple[str, str]]:
    """Links that self-collision watches, two and two.

    Those that are neither neighbours nor near in every posture, one at least beyond the macro arm;
    where there is no macro arm, all of them. Left out are links with at most three joints between
    them that come no nearer than `d_min` [m] in any of 1000 random postures: such as turn about one
    axis.
    """
    names, joints = robot.link_names, robot.joint_names[macro_joints:]

    def carried(link: int) -> bool:
        return any(robot.moves(joint, names[link]) for joint in joints)

    def between(a: int, b: int) -> int:
        return sum(robot.moves(j, names[a]) != robot.moves(j, names[b]) for j in robot.joint_names)

    pairs = [(a, b) for a, b in Surfaces.of(robot).self_pairs.tolist() if carried(a) or carried(b)]
    apart = _never_near(robot, [pair for pair in pairs if between(*pair) <= _FEW_JOINTS], d_min)
    return [(names[a], names[b]) for a, b in pairs if (a, b) not in apart]


def _never_near(robot: Robot, pairs: list[tuple[int, int]], d_min: float) -> set[tuple[int, int]]:
    """Those of the pairs that no random posture brings nearer than `d_min` [m]; kept in a cache."""

    def never_near() -> list[tuple[int, int]]:
        left = list(pairs)
        for q in random_postures(robot, _SAMPLES):
            near = np.asarray(_core.self_distances(robot, q, left, d_min)) < d_min
            left = [pair for pair, is_near in zip(left, near, strict=True) if not is_near]
        return left

    key = [_SAMPLES, d_min, pairs, robot.digest]
    return {(int(a), int(b)) for a, b in cached_pairs("never_near", key, never_near)}


def manipulability(J: Array, first: int, joints: int) -> float:
    """sqrt(det(J J')) of an arm's columns of the tool's Jacobian."""
    return float(np.prod(np.linalg.svd(J[:, first : first + joints], compute_uv=False)))


@once_per_robot
def largest_manipulability(robot: Robot, first: int, joints: int) -> float:
    """Of 4000 random postures of the whole robot, the same ones for the same robot."""
    return max(
        manipulability(robot.tool_jacobian(q), first, joints)
        for q in random_postures(robot, _POSTURES)
    )


def speeds(robot: Robot, macro_joints: int, q: Array, qd: Array) -> Array:
    """(n, 2) how fast the macro and the micro arm each move the tool, |J_arm qd_arm| [m/s].

    Args:
        robot: of both arms.
        macro_joints: so many first joints are those of the macro arm.
        q: (n, n_q) postures.
        qd: (n, n_q) velocities there.
    """
    out = np.zeros((len(q), 2))
    for row, (posture, velocity) in enumerate(zip(q, qd, strict=True)):
        J = robot.tool_jacobian(posture)[:3]
        out[row, 0] = np.linalg.norm(J[:, :macro_joints] @ velocity[:macro_joints])
        out[row, 1] = np.linalg.norm(J[:, macro_joints:] @ velocity[macro_joints:])
    return out

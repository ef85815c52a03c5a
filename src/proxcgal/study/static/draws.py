"""Random scenes round a given one: panel, start posture and goal, drawn from a seed."""

import zlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from proxcgal import _core
from proxcgal.core.errors import ConfigError
from proxcgal.core.transforms import inverse, placed, sine_axis
from proxcgal.core.typing import Array
from proxcgal.models.robots import Robot
from proxcgal.models.surfaces import Surfaces
from proxcgal.scenario.loading import change_scenario
from proxcgal.scenario.scenario import Scenario

# Uniform, to either side of the scene's own value. Fixed before any drawn scene was run.
POSITION_M = 0.10  # of the panel's centre, along each axis
TILT_RAD = 0.26  # of the panel, 15 degrees of each of roll, pitch, yaw
POSTURE_RAD = 0.20  # of each joint at the start
GOAL_M = 0.15  # of the goal's offset, along each axis

OWN_CLEARANCE_M = 0.03  # between own links at the start
REACHED_M, REACHED_RAD = 0.001, 0.01  # a goal is within reach where a posture comes this near
_TRIES = 1000
_DIGITS = 4  # 0.1 mm, 0.1 mrad: what the command that repeats a draw says is all there is


@dataclass(frozen=True, slots=True, kw_only=True)
class Draw:
    """One scene as drawn."""

    overrides: tuple[str, ...]  # of the scene that it was drawn round
    scenario: Scenario
    redrawn: Counter[str]  # how often each reason made another draw necessary


def draw_scene(base: Scenario, robot: Robot, seed: int, number: int) -> Draw:
    """The scene of that number: the same for the same scene, seed and number.

    Another is drawn instead where the start is outside the joints' limits, own links start nearer
    than 0.03 m, the arm starts within the avoidance zone (d_min + Delta), the line from the tool
    to the goal misses the panel, or no posture reaches the goal.

    Args:
        base: a scene with one box and a goal given as an offset.
        robot: the base's.
        seed: of the campaign.
        number: of the draw, from 0.

    Raises:
        ConfigError: the base has no box or no offset, or hardly any draw would do.
    """
    shapes = [box.shape if not box.path else f"moving {box.shape}" for box in base.obstacles]
    if shapes != ["box"] or base.goal.offset is None:
        raise ConfigError(
            f"scenario {base.name}: scenes can be drawn round one with exactly one obstacle, a box "
            f"that stands still, and goal.offset; it has {', '.join(shapes) or 'no obstacle'} and "
            f"goal.offset = {base.goal.offset}"
        )
    generator = np.random.default_rng([seed, zlib.crc32(base.name.encode()), number])
    redrawn: Counter[str] = Counter()
    for _ in range(_TRIES):
        overrides = _overrides(base, base.goal.offset, generator)
        scenario = change_scenario(base, base.name, overrides)
        reason = _unfit(scenario, robot)
        if reason is None:
            return Draw(overrides=overrides, scenario=scenario, redrawn=redrawn)
        redrawn[reason] += 1
    counts = ", ".join(f"{reason} {count} times" for reason, count in redrawn.most_common())
    raise ConfigError(f"scenario {base.name}: none of {_TRIES} draws round it will do: {counts}")


def _overrides(
    base: Scenario, offset: Sequence[float], generator: np.random.Generator
) -> tuple[str, ...]:
    panel = base.obstacles[0]
    drawn = (
        ("obstacle.0.position", panel.position, POSITION_M),
        ("obstacle.0.rpy", panel.rpy, TILT_RAD),
        ("q0", base.q0, POSTURE_RAD),
        ("goal.offset", offset, GOAL_M),
    )
    return tuple(
        f"{key}={_text(np.asarray(middle) + generator.uniform(-spread, spread, len(middle)))}"
        for key, middle, spread in drawn
    )


def _text(values: Array) -> str:
    return "[" + ",".join(f"{value:.{_DIGITS}f}" for value in values) + "]"


def _unfit(scenario: Scenario, robot: Robot) -> str | None:
    """Why a draw will not do; None where it does. What costs least is looked at first."""
    q0, panel, settings = np.array(scenario.q0), scenario.obstacles[0], scenario.controller
    if ((q0 < robot.q_min) | (q0 > robot.q_max)).any():
        return "start outside the joints' limits"
    goal = np.array(robot.tool_pose(q0))
    start_W = goal[:3, 3].copy()
    goal[:3, 3] += scenario.goal.offset or (0.0, 0.0, 0.0)
    if not crosses(panel.size, panel.pose(), start_W, goal[:3, 3]):
        return "panel not between tool and goal"
    surfaces, poses_W = Surfaces.of(robot), np.asarray(robot.link_poses(q0))
    for a, b in surfaces.self_pairs:
        T_AB = inverse(poses_W[a]) @ poses_W[b]
        if surfaces.trees[a].distance(surfaces.trees[b], T_AB, OWN_CLEARANCE_M)[0] < np.inf:
            return "own links too near at the start"
    vertices_O, triangles = panel.solid().core()
    plate = _core.MeshTree(placed(panel.pose(), vertices_O), triangles)
    for link in surfaces.moving:
        if (
            plate.distance(surfaces.trees[link], poses_W[link], settings.d_min + settings.buffer)[0]
            < np.inf
        ):
            return "panel too near at the start"
    if not reachable(robot, q0, goal):
        return "goal out of reach"
    return None


def crosses(size: Sequence[float], T_WO: Array, start_W: Array, end_W: Array) -> bool:
    """Does the straight line between two points pass through the middle plane of a plate?"""
    half = 0.5 * np.asarray(size)
    thin = int(half.argmin())
    start, end = ((point - T_WO[:3, 3]) @ T_WO[:3, :3] for point in (start_W, end_W))
    if start[thin] * end[thin] >= 0.0:
        return False
    share = start[thin] / (start[thin] - end[thin])
    at = np.abs(start + share * (end - start))
    at[thin] = 0.0
    return bool((at <= half).all())


def reachable(robot: Robot, q0: Array, goal: Array) -> bool:
    """Is there a posture within the joints' limits that brings the tool to a pose T_WT?

    Looked for by damped least squares from the start and from 20 random postures near it and
    anywhere: what is not found counts as out of reach.
    """
    generator = np.random.default_rng(0)
    low, high = np.maximum(robot.q_min, -np.pi), np.minimum(robot.q_max, np.pi)
    starts = [q0, *(q0 + generator.uniform(-1.0, 1.0, (10, robot.n_q)))]
    starts += list(generator.uniform(low, high, (10, robot.n_q)))
    return any(_solves(robot, np.array(q), goal) for q in starts)


def _solves(robot: Robot, q: Array, goal: Array) -> bool:
    for _ in range(60):
        T_WT = robot.tool_pose(q)
        turn = goal[:3, :3] @ T_WT[:3, :3].T
        axis = sine_axis(turn)
        error = np.concatenate([goal[:3, 3] - T_WT[:3, 3], axis])
        upright = np.trace(turn) > 1.0  # else the axis vanishes at half a turn
        if np.linalg.norm(error[:3]) < REACHED_M and np.linalg.norm(axis) < REACHED_RAD and upright:
            return True
        J = robot.jacobian(q, robot.link_names[-1], T_WT[:3, 3])
        step = J.T @ np.linalg.solve(J @ J.T + 1e-4 * np.eye(6), error)
        q = np.clip(q + np.clip(step, -0.3, 0.3), robot.q_min, robot.q_max)
    return False

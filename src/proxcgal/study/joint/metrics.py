"""One run of the 12-joint robot as numbers, and as curves at ten points a second."""

import json
from typing import Any

import numpy as np

from proxcgal.core.files import NOTHING_M
from proxcgal.core.modes import HOLD
from proxcgal.core.typing import Array
from proxcgal.evaluation.ground_truth import GroundTruth
from proxcgal.evaluation.trial_log import TrialLog
from proxcgal.models import macro_micro
from proxcgal.models.robots import Robot
from proxcgal.scenario.scenario import Scenario
from proxcgal.study.campaign_store import Row

SERIES_S = 0.1  # [s] between the points of a curve
COLUMNS = (
    "succeeded", "outcome", "reason", "time_s", "position_error_m", "angle_error_rad",
    "true_min_m", "true_min_link", "seen_min_m", "seen_at_true_min_m", "min_altitude_m",
    "limit_margin_rad", "limit_joint", "manipulability_macro", "manipulability_micro",
    "macro_share", "way_m", "self_min_m", "held_ticks", "holds_task", "holds_link",
    "holds_obstacle", "holds_sensor", "holds_zone", "tick_p99_us", "series",
)  # fmt: skip


def joint_metrics(log: TrialLog, scenario: Scenario, robot: Robot) -> Row:
    """The numbers of one run, by the names of COLUMNS.

    `macro_share` is the integral of |J_macro qd_macro| over that plus |J_micro qd_micro|, linear
    rows at the tool; manipulability counts as a share of the arm's largest; `min_altitude_m` is the
    tool's.
    """
    macro = scenario.controller.macro_joints
    speed = macro_micro.speeds(robot, macro, log.q, log.qd)
    moved = speed.sum(axis=0)
    margin = np.minimum(log.q - robot.q_min, robot.q_max - log.q)
    tick, joint = np.unravel_index(int(np.argmin(margin)), margin.shape)
    numbers = log.summary()
    has_truth = np.isfinite(log.true_m).any()
    nearest = int(np.nanargmin(log.true_m)) if has_truth else 0
    ending = log.ending
    held = ending.holding if ending is not None else None
    return {
        "succeeded": ending is not None and ending.outcome == "succeeded",
        "outcome": ending.outcome if ending is not None else "aborted",
        "reason": ending.reason if ending is not None else "",
        "time_s": float(log.elapsed[-1]),
        "position_error_m": float(log.goal_error_m[-1]),
        "angle_error_rad": float(log.goal_angle_rad[-1]),
        "true_min_m": numbers["true_min_m"],
        "true_min_link": log.true_link[nearest] if has_truth else "",
        "seen_min_m": numbers["seen_min_m"],
        "seen_at_true_min_m": min(float(log.seen_m[nearest]), NOTHING_M),
        "min_altitude_m": float(log.tool_W[:, 2].min()),
        "limit_margin_rad": float(margin[tick, joint]),
        "limit_joint": robot.joint_names[int(joint)],
        **_manipulability(robot, macro, log.q),
        "macro_share": float(moved[0] / moved.sum()) if moved.sum() > 0.0 else 0.0,
        "way_m": float(np.linalg.norm(np.diff(log.tool_W, axis=0), axis=1).sum()),
        "self_min_m": numbers["self_min_m"],
        "held_ticks": int((log.mode >= HOLD).sum()),
        "holds_task": held.task if held is not None else "",
        "holds_link": held.link if held is not None else "",
        "holds_obstacle": held.obstacle if held is not None else "",
        "holds_sensor": held.sensor if held is not None else -1,
        "holds_zone": held.zone if held is not None else -1,
        "tick_p99_us": float(np.percentile(log.tick_us, 99)),
        "series": json.dumps(_series(log, scenario, robot, speed), separators=(",", ":")),
    }


def _manipulability(robot: Robot, macro: int, q: Array) -> dict[str, float]:
    """The least of each arm over the run, as a share of its largest; every tenth tick."""
    jacobians = [macro_micro.tool_jacobian(robot, posture) for posture in q[::10]]
    least = {}
    for arm in ("macro", "micro"):
        first, joints = macro_micro.part(robot, macro, arm)
        unit = macro_micro.largest_manipulability(robot, first, joints)
        least[f"manipulability_{arm}"] = min(
            macro_micro.manipulability(J, first, joints) / unit for J in jacobians
        )
    return least


def _series(log: TrialLog, scenario: Scenario, robot: Robot, speed: Array) -> dict[str, Any]:
    period = 1.0 / scenario.simulation.control_hz
    rows = np.arange(0, len(log.time), max(round(SERIES_S / period), 1))
    truth = GroundTruth(robot, scenario.scene())
    true = [truth(log.q[row], float(log.elapsed[row])).distance for row in rows]

    def rounded(values: Any) -> list[float | None]:
        return [round(float(v), 4) if np.isfinite(v) else None for v in values]

    return {
        "time": rounded(log.elapsed[rows]),
        "macro": rounded(speed[rows, 0]),
        "micro": rounded(speed[rows, 1]),
        "true": rounded(true),
        "seen": rounded(log.seen_m[rows]),
        "error": rounded(log.goal_error_m[rows]),
        "activation": {
            name: rounded(log.task_activation[rows, level])
            for level, name in enumerate(scenario.controller.levels)
        },
    }

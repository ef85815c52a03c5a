"""One trial beside a human as numbers, and its course at the sensors' rate."""

import json

import numpy as np

from proxcgal.core.modes import HOLD
from proxcgal.core.typing import Array
from proxcgal.evaluation.phases import SAMPLES_HZ, mean_distances
from proxcgal.evaluation.trial_log import TOO_CLOSE, TrialLog, sampled_ticks
from proxcgal.scenario.hri_scenario import HriScenario
from proxcgal.study.campaign_store import Row, Series
from proxcgal.study.trial_simulation import robot_of

#: Of the ticks under 0.05 m: the human was in a blind spot where the cloud's nearest point was
#: this much farther away than the human really was, or there was none.
UNSEEN_M = 0.05
_ROUNDING = 1e-6  # of a limit
COLUMNS = (
    "mean_m", "seen_mean_m", "empty_ticks", "ticks", "true_min_m", "true_min_link",
    "too_close_ticks", "blind_ticks", "self_min_m", "leaked_points_max", "held_ticks", "finite",
    "limits_kept", "phase_means", "windows", "signals", "d_min_m", "buffer_m", "true_m", "seen_m",
    "activation",
)  # fmt: skip


def trial_metrics(log: TrialLog, scenario: HriScenario) -> Row:
    """The numbers of one trial, by the names of COLUMNS.

    Args:
        log: with the true distance at least at the samples, and wherever it is under 0.05 m.
        scenario: what was run.
    """
    summary = log.summary()
    samples = sampled_ticks(log.elapsed, SAMPLES_HZ)
    close = log.true_m < TOO_CLOSE
    seen = np.isfinite(log.seen_m)
    means = mean_distances(log, scenario)
    mean, seen_mean = means.pop("cycle")
    finite = bool(np.isfinite(log.qd).all() and np.isfinite(log.q).all())
    settings = scenario.controller
    return {
        "mean_m": mean,
        "seen_mean_m": seen_mean,
        "empty_ticks": int((~seen).sum()),
        "ticks": len(log.elapsed),
        "true_min_m": summary["true_min_m"],
        "true_min_link": log.true_link[int(np.nanargmin(log.true_m))],
        "too_close_ticks": int(close.sum()),
        "blind_ticks": int((close & (log.seen_m - log.true_m > UNSEEN_M)).sum()),
        "self_min_m": summary["self_min_m"],
        "leaked_points_max": summary["leaked_points_max"],
        "held_ticks": int((log.mode >= HOLD).sum()),
        "finite": finite,
        "limits_kept": finite and _limits_kept(log, scenario),
        "phase_means": json.dumps(means),
        "windows": json.dumps(scenario.windows()),
        "signals": json.dumps(scenario.signals()),
        "d_min_m": settings.d_min,
        "buffer_m": settings.buffer,
        "true_m": _series(log.true_m[samples]),
        "seen_m": _series(log.seen_m[samples]),
        "activation": _series(log.activation[samples]),
    }


def _limits_kept(log: TrialLog, scenario: HriScenario) -> bool:
    """Joint positions, speeds and accelerations of every command within the robot's limits."""
    robot, slack = robot_of(scenario), 1.0 + _ROUNDING
    period = 1.0 / scenario.simulation.control_hz
    change = np.diff(log.qd, axis=0, prepend=np.zeros((1, robot.n_q))) / period
    inside = (log.q >= robot.q_min - _ROUNDING) & (log.q <= robot.q_max + _ROUNDING)
    return bool(
        inside.all()
        and (np.abs(log.qd) <= robot.qd_max * slack).all()
        and (np.abs(change) <= robot.qdd_max * slack).all()
    )


def _series(values: Array) -> Series:
    """Tenths of a millimetre, or of a thousandth; None where there is nothing."""
    return [round(v, 4) if np.isfinite(v) else None for v in values.tolist()]

"""Mean distances of a trial beside a person: over the whole cycle and phase by phase."""

import numpy as np

from proxcgal.core.typing import Array
from proxcgal.evaluation.trial_log import NOTHING, TrialLog, sampled_ticks
from proxcgal.scenario.hri_scenario import HriScenario

SAMPLES_HZ = 15.0  # the sensors' rate: means of the true distance and all courses are taken at it
Means = dict[str, tuple[float | None, float | None]]  # true and seen [m], None without any


def mean_distances(log: TrialLog, scenario: HriScenario) -> Means:
    """By phase; "cycle" is all of the run.

    True distances are taken at the sensors' rate, seen ones at every tick with something in view,
    as the paper has it.
    """
    samples = sampled_ticks(log.elapsed, SAMPLES_HZ)
    seen = np.isfinite(log.seen_m)
    found = {}
    for phase, (start, end) in {"cycle": (0.0, np.inf), **scenario.windows()}.items():
        inside = (log.elapsed >= start) & (log.elapsed < end)
        found[phase] = _mean(log.true_m[inside & samples]), _mean(log.seen_m[inside & seen])
    return found


def _mean(values: Array) -> float | None:
    return float(np.minimum(values, NOTHING).mean()) if len(values) else None

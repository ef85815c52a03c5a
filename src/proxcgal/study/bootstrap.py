"""How sure a median is, a mean, or a ratio of sums."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from proxcgal.core.typing import Array

RESAMPLES = 10_000
CONFIDENCE = 0.95
ENOUGH = 6  # values: of fewer, a resampled interval is no more than their range
_PARTS = 20


@dataclass(frozen=True, slots=True)
class Interval:
    """A median, mean or ratio with its bootstrap interval."""

    middle: float
    low: float
    high: float


def ratio_interval(
    above: Sequence[float] | Array,
    below: Sequence[float] | Array,
    seed: int = 0,
) -> Interval | None:
    """sum(above) / sum(below) over pairs, and its 95 % percentile bootstrap interval.

    Resamples whose sum below is not above 0 have no ratio; where more than 1 in 20 of them have
    none, the sum below may as well be 0, and there is neither ratio nor interval: None.
    """
    up, down = np.asarray(above, np.float64), np.asarray(below, np.float64)
    if not len(up) or not down.sum() > 0.0:
        return None
    rows = np.random.default_rng(seed).integers(len(up), size=(RESAMPLES, len(up)))
    sums = up[rows].sum(axis=1), down[rows].sum(axis=1)
    good = sums[1] > 0.0
    if good.mean() < CONFIDENCE:
        return None
    return _percentile_interval(float(up.sum() / down.sum()), sums[0][good] / sums[1][good])


def median_interval(values: Sequence[float], seed: int = 0) -> Interval | None:
    """The median and the 95 % percentile bootstrap interval of it; None without values.

    The resamples are drawn from `seed`: the same values always give the same interval.
    """
    return _interval(values, np.median, seed)


def mean_interval(values: Sequence[float], seed: int = 0) -> Interval | None:
    """As `median_interval`, of the mean."""
    return _interval(values, np.mean, seed)


def _interval(values: Sequence[float], middle: Any, seed: int) -> Interval | None:
    sample = np.asarray(values, np.float64)
    if not len(sample):
        return None
    generator = np.random.default_rng(seed)
    middles = np.empty(RESAMPLES)
    for part in np.split(middles, _PARTS):  # all at once would take memory
        rows = generator.integers(len(sample), size=(len(part), len(sample)))
        part[:] = middle(sample[rows], axis=1)
    return _percentile_interval(float(middle(sample)), middles)


def _percentile_interval(middle: float, resampled: Array) -> Interval:
    tail = 50.0 * (1.0 - CONFIDENCE)
    low, high = np.percentile(resampled, [tail, 100.0 - tail])
    return Interval(middle, float(low), float(high))

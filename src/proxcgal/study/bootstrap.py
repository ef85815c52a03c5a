"""How sure a median is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

RESAMPLES = 10_000
CONFIDENCE = 0.95
_PARTS = 20


@dataclass(frozen=True, slots=True)
class Interval:
    """A median with its bootstrap interval."""

    median: float
    low: float
    high: float


def median_interval(values: Sequence[float], seed: int = 0) -> Interval | None:
    """The median and the 95 % percentile bootstrap interval of it; None without values.

    The resamples are drawn from `seed`: the same values always give the same interval.
    """
    sample = np.asarray(values, np.float64)
    if not len(sample):
        return None
    generator = np.random.default_rng(seed)
    medians = np.empty(RESAMPLES)
    for part in np.split(medians, _PARTS):  # all at once would take memory
        rows = generator.integers(len(sample), size=(len(part), len(sample)))
        part[:] = np.median(sample[rows], axis=1)
    tail = 50.0 * (1.0 - CONFIDENCE)
    low, high = np.percentile(medians, [tail, 100.0 - tail])
    return Interval(float(np.median(sample)), float(low), float(high))

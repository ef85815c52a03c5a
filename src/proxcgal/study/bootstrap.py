"""How sure a median is, a mean, or a ratio of sums; controllers paired on the same draws."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from proxcgal.core.files import NOTHING_M
from proxcgal.core.typing import Array

RESAMPLES = 10_000
CONFIDENCE = 0.95
ENOUGH = 6  # values: of fewer, a resampled interval is no more than their range
_PARTS = 20
Distances = Mapping[str, Mapping[int, float]]  # [m] by controller, then by draw or subject


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


@dataclass(frozen=True, slots=True)
class Pairs:
    """Distances of what both controllers met, (n,) each [m]."""

    one: Array
    other: Array

    @property
    def apart_mm(self) -> list[float]:
        """How much farther away the first is [mm]."""
        return [float(apart) for apart in 1000.0 * (self.one - self.other)]


def by_controller(table: pl.DataFrame, measure: str, each: str) -> Distances:
    """One measure of a campaign's trials.

    Args:
        table: of one scene's trials.
        measure: column of a distance [m].
        each: column of the draw or subject.
    """
    return {
        str(name): dict(part.select(each, measure).iter_rows())
        for (name,), part in table.group_by(["controller"], maintain_order=True)
    }


def draw_distances(table: pl.DataFrame, measure: str = "true_final_m") -> Distances:
    """One measure of the draws; trials that failed, or saw nothing to be distant from, left out."""
    done = table.filter(pl.col("error").is_null(), pl.col(measure) < NOTHING_M)
    return by_controller(done, measure, "draw")


def pairs(distances: Distances, one: str, other: str) -> Pairs:
    """Both controllers' distances, of the draws or subjects that both have."""
    first, second = distances.get(one, {}), distances.get(other, {})
    both = sorted(first.keys() & second.keys())
    return Pairs(
        np.array([first[each] for each in both]), np.array([second[each] for each in both])
    )

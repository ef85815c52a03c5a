"""Controllers beside one another on the same draws, or with the same subjects."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import polars as pl

from proxcgal.core.files import NOTHING_M
from proxcgal.core.typing import Array

Distances = Mapping[str, Mapping[int, float]]  # [m] by controller, then by draw or subject


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

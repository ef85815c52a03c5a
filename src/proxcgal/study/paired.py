"""Controllers beside one another on the same draws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import polars as pl

from proxcgal.core.files import NOTHING_M
from proxcgal.core.typing import Array

Ends = Mapping[str, Mapping[int, float]]


@dataclass(frozen=True, slots=True)
class Pairs:
    """True distances at the end of the draws that both controllers ended, (n,) each [m]."""

    one: Array
    other: Array

    @property
    def apart_mm(self) -> list[float]:
        """How much farther away the first ends [mm]."""
        return [float(apart) for apart in 1000.0 * (self.one - self.other)]


def ends_of(table: pl.DataFrame, measure: str = "true_final_m") -> Ends:
    """True distance at the end, or another measure of it, by controller and draw [m].

    Trials that failed, or have nothing to be distant from, are left out.
    """
    done = table.filter(pl.col("error").is_null(), pl.col(measure) < NOTHING_M)
    return {
        str(name): dict(part.select("draw", measure).iter_rows())
        for (name,), part in done.group_by(["controller"], maintain_order=True)
    }


def pairs(ends: Ends, one: str, other: str) -> Pairs:
    """Both controllers' ends in the draws that both have."""
    first, second = ends.get(one, {}), ends.get(other, {})
    draws = sorted(first.keys() & second.keys())
    return Pairs(np.array([first[d] for d in draws]), np.array([second[d] for d in draws]))

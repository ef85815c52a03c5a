"""What the body filter made of the sensors' points, as pictures need it."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from proxcgal import _core
from proxcgal.core.typing import Array

Points = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Clouds:
    """The raw cloud in two parts."""

    kept_W: Points  #: (n, 3) the filtered cloud [m]
    removed_W: Points  #: (m, 3) what was taken for the arm [m]

    @classmethod
    def of(cls, ctrl: _core.Controller) -> Self:
        """Those of the last tick, copied."""
        kept, raw = ctrl.cloud_W(), ctrl.raw_cloud_W()
        return cls(kept.astype(np.float32), without(raw, kept).astype(np.float32))


def without(points: Array, some: Array) -> Array:
    """Those rows of (n, 3) that are not among the rows of `some`, bit for bit."""
    if not len(points) or not len(some):
        return points
    return np.asarray(points[~np.isin(_rows(points), _rows(some))])


def _rows(points: Array) -> NDArray[np.void]:
    """(n,) each row as one value that compares by its bytes."""
    return np.ascontiguousarray(points).view(np.dtype((np.void, 3 * points.itemsize))).ravel()

"""Curves of the last seconds: seen and true distance, activation."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
import viser
import viser.uplot
from numpy.typing import NDArray

from proxcgal.sim.moment import Moment

Array = NDArray[np.float64]

SPAN = 10.0  #: [s]
HIGHEST = 1.0  # [m] farther is drawn there
_SEEN, _TRUE, _BOUND = "#d61e28", "#2a5fb0", "#8a8f98"
_HEIGHT = 165  # [px]


class Plots:
    """Two plots in the page's panel, over the last 10 s."""

    def __init__(self, gui: viser.GuiApi) -> None:
        """Adds them."""
        self._rows: deque[tuple[float, float, float, float]] = deque()
        none = np.array([0.0, SPAN])
        self._distance = gui.add_uplot(
            (none, none, none, none, none),
            _series(("seen", _SEEN, ()), ("true", _TRUE, (5, 4)), ("d_min", _BOUND, (2, 3)),
                    ("d_min + buffer", _BOUND, (2, 3))),
            title="distance [m], time [s]", height=_HEIGHT, scales=_scales(HIGHEST), axes=_AXES,
            legend={"show": True, "live": False},
        )  # fmt: skip
        self._activation = gui.add_uplot(
            (none, none), _series(("activation", "#10963c", ())),
            title="activation of avoidance, time [s]", height=_HEIGHT - 45, scales=_scales(1.0),
            axes=_AXES, legend={"show": False},
        )  # fmt: skip

    def add(self, moment: Moment) -> None:
        """One moment more; a time before the last one begins anew."""
        if self._rows and moment.elapsed < self._rows[-1][0]:
            self._rows.clear()
        if self._rows and moment.elapsed == self._rows[-1][0]:
            self._rows.pop()
        self._rows.append((moment.elapsed, _drawn(moment.seen), _drawn(moment.true),
                           moment.activation))  # fmt: skip
        while self._rows[0][0] < moment.elapsed - SPAN:
            self._rows.popleft()

    def show(self, d_min: float, buffer: float) -> None:
        """Draws what was added, with the law's two thresholds [m]."""
        if len(self._rows) < 2:
            return
        time, seen, true, activation = np.array(self._rows).T
        low, high = np.full_like(time, d_min), np.full_like(time, d_min + buffer)
        self._distance.data = (time, seen, true, low, high)
        self._activation.data = (time, activation)


def _drawn(distance: float) -> float:
    return min(distance, HIGHEST) if distance == distance else HIGHEST


def _series(*curves: tuple[str, str, tuple[int, ...]]) -> tuple[Any, ...]:
    return (
        viser.uplot.Series(label="time"),
        *(
            viser.uplot.Series(label=label, stroke=stroke, width=2 if not dash else 1.5, dash=dash)
            for label, stroke, dash in curves
        ),
    )


def _scales(highest: float) -> dict[str, Any]:
    return {
        "x": viser.uplot.Scale(time=False, auto=True),
        "y": viser.uplot.Scale(auto=False, range=(0.0, highest)),
    }


_AXES: Any = (viser.uplot.Axis(size=28), viser.uplot.Axis(size=40))

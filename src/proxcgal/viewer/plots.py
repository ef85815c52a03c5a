"""Curves of the last seconds: seen and true distance, activation."""

from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
import viser
import viser.uplot

from proxcgal.core.typing import Array
from proxcgal.sim.moment import Moment, Posed
from proxcgal.viewer.scene_model import SceneModel

Curve = tuple[str, str, tuple[int, ...]]  # label, colour, dashes [px]

SPAN = 10.0  #: [s]
HIGHEST = 1.0  # [m] farther is drawn there
_SEEN, _TRUE, _BOUND, _GREEN, _ORANGE = "#d61e28", "#2a5fb0", "#8a8f98", "#10963c", "#dc7814"
_HEIGHT = 165  # [px]


class RecentRows:
    """Numbers over the last 10 s."""

    def __init__(self) -> None:
        """None yet."""
        self._rows: deque[tuple[float, ...]] = deque()

    @property
    def last(self) -> float | None:
        """Time of the last row [s]."""
        return self._rows[-1][0] if self._rows else None

    @property
    def drawable(self) -> bool:
        """Whether there are rows enough for a curve."""
        return len(self._rows) > 1

    def add(self, elapsed: float, *values: float) -> None:
        """Adds a row in place of one of the same time; an earlier time clears the others."""
        if self._rows and elapsed < self._rows[-1][0]:
            self._rows.clear()
        if self._rows and elapsed == self._rows[-1][0]:
            self._rows.pop()
        self._rows.append((elapsed, *values))
        while self._rows[0][0] < elapsed - SPAN:
            self._rows.popleft()

    def columns(self) -> Array:
        """Times [s], then each number, (1 + numbers, rows)."""
        return np.array(self._rows).T


class Plots:
    """Two plots in the page's panel, over the last 10 s."""

    def __init__(self, gui: viser.GuiApi) -> None:
        """Adds them."""
        self._rows = RecentRows()
        self._distance = _distances(gui, ("seen", _SEEN, ()), ("true", _TRUE, (5, 4)))
        self._activation = _activations(gui, ("activation", _GREEN, ()))

    def add(self, moment: Posed) -> None:
        """One moment more; an earlier time than the last one clears the curves."""
        assert isinstance(moment, Moment)
        self._rows.add(moment.elapsed, moment.seen, moment.true, moment.activation)

    def show(self, d_min: float, buffer: float) -> None:
        """Draws what was added, with the controller's two thresholds [m]."""
        if not self._rows.drawable:
            return
        time, seen, true, activation = self._rows.columns()
        low, high = np.full_like(time, d_min), np.full_like(time, d_min + buffer)
        self._distance.data = (time, _drawn(seen), _drawn(true), low, high)
        self._activation.data = (time, activation)


def plot_whole_run(
    gui: viser.GuiApi, moments: Sequence[Moment], again: Sequence[Moment] | None, model: SceneModel
) -> None:
    """The same plots of a recorded run, and of the one that was computed again beside it."""
    curves: list[Curve] = [("seen", _SEEN, ()), ("true", _TRUE, (5, 4))]
    active: list[Curve] = [("activation", _GREEN, ())]
    distances = [[m.seen for m in moments], [m.true for m in moments]]
    activations = [[m.activation for m in moments]]
    if again is not None:
        curves.append(("seen, recomputed", _ORANGE, ()))
        active.append(("recomputed", _ORANGE, ()))
        distances.append([m.seen for m in again])
        activations.append([m.activation for m in again])
    time = np.array([moment.elapsed for moment in moments])
    bounds = [np.full_like(time, model.d_min), np.full_like(time, model.d_min + model.buffer)]
    _distances(gui, *curves).data = (time, *(_drawn(np.array(d)) for d in distances), *bounds)
    _activations(gui, *active).data = (time, *map(np.array, activations))


def _distances(gui: viser.GuiApi, *curves: Curve) -> Any:
    bounds: list[Curve] = [("d_min", _BOUND, (2, 3)), ("d_min + buffer", _BOUND, (2, 3))]
    return plot(
        gui, f"distance [m], clipped at {HIGHEST:g}; time [s]", HIGHEST, _HEIGHT, *curves, *bounds
    )


def _activations(gui: viser.GuiApi, *curves: Curve) -> Any:
    return plot(gui, "activation of avoidance, time [s]", 1.0, _HEIGHT - 45, *curves)


def plot(gui: viser.GuiApi, title: str, highest: float, height: int, *curves: Curve) -> Any:
    """An empty plot over time; what is higher than `highest` is drawn there."""
    nothing = np.array([0.0, SPAN])
    return gui.add_uplot(
        (nothing,) * (1 + len(curves)),
        (
            viser.uplot.Series(label="time"),
            *(
                viser.uplot.Series(label=label, stroke=stroke, width=1.5 if dash else 2, dash=dash)
                for label, stroke, dash in curves
            ),
        ),
        title=title,
        height=height,
        scales={
            "x": viser.uplot.Scale(time=False, auto=True),
            "y": viser.uplot.Scale(auto=False, range=(0.0, 1.04 * highest)),
        },
        axes=(viser.uplot.Axis(size=34), viser.uplot.Axis(size=46)),
        legend={"show": len(curves) > 1, "live": False},
    )


def _drawn(distances: Array) -> Array:
    return np.minimum(np.nan_to_num(distances, nan=HIGHEST), HIGHEST)

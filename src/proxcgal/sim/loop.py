"""The one way through: source -> injected faults -> tick; whoever iterates records."""

from __future__ import annotations

import time as clock
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from proxcgal import _core
from proxcgal.sim.faults import FaultInjector
from proxcgal.sim.source import Source
from proxcgal.sim.ticks import TickInput, TickResult


def run_ticks(
    source: Source,
    law: _core.Controller,
    faults: FaultInjector | None = None,
    known_points_W: NDArray[np.float64] | None = None,
) -> Iterator[tuple[TickInput, TickResult]]:
    """Tick after tick until the source ends; `law` then holds the state after the yielded one.

    Args:
        source: of inputs; it is told each command.
        law: the controller.
        faults: between source and tick.
        known_points_W: (n, 3) for ticks that are given the scene itself [m].
    """
    points = np.empty((0, 3)) if known_points_W is None else known_points_W
    while (given := source.read()) is not None:
        if faults is not None:
            given = faults(given)
        scans = list(given.scans)
        start = clock.perf_counter_ns()
        if given.known:
            out = law.tick_known(given.time, given.q, points, given.goal)
        else:
            out = law.tick(given.time, given.q, scans, given.goal, given.late, given.q_stamp)
        tick_us = (clock.perf_counter_ns() - start) / 1000.0
        result = TickResult.of(out, len(law.cloud_origins()), tick_us)
        source.command(result.qd)
        yield given, result

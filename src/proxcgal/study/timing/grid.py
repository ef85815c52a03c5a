"""The timing grid of [WA] III-C and IV-C: both algorithms by both methods, cell by cell."""

import gc
import math
import time
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from statistics import NormalDist
from typing import Any

import numpy as np

from proxcgal import _core
from proxcgal.core.errors import SimulationError
from proxcgal.core.typing import Array
from proxcgal.evaluation.metrics import Summary
from proxcgal.study.timing.inputs import Inputs

ALGORITHMS = {1: "robot body removal", 2: "closest pair"}
METHODS = ("paper", "fast")
CONFIDENCE = 0.95  # of an exponent's interval
SAME_M = 1e-9  # [m] both methods' distances agree to this


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How long calls are measured."""

    seconds: float  # each call's own, over all rounds
    rounds: int  # the calls take turns; each is timed at least once a round, however long it takes
    most: int  # times of each call, however short it is


FULL = Effort(seconds=2.0, rounds=5, most=2000)
QUICK = Effort(seconds=0.15, rounds=3, most=600)


@dataclass(frozen=True, slots=True, kw_only=True)
class TimingCell:
    """One cell's times, as a caller in Python meets them."""

    robot: str
    vertices: int
    cloud: str
    points: int  # that the algorithm is given
    algorithm: int
    method: str
    samples_us: Array  # (n,) wall time of each call

    @property
    def median_us(self) -> float:
        """Half of the calls were shorter."""
        return float(np.median(self.samples_us))

    def numbers(self) -> dict[str, Any]:
        """The cell as `summary.json` has it."""
        return {
            "robot": self.robot, "vertices": self.vertices, "cloud": self.cloud,
            "points": self.points, "algorithm": self.algorithm, "method": self.method,
            "median_us": self.median_us,
            "p99_us": float(np.percentile(self.samples_us, 99)),
            "max_us": float(self.samples_us.max()),
        }  # fmt: skip


def measure(calls: Mapping[str, Callable[[], object]], effort: Effort) -> dict[str, Array]:
    """Wall times [us] of calls that take turns: what slows the machine for a while slows all.

    In each round a call is made once to warm up, and then timed for its share of the effort.
    """
    samples: dict[str, list[int]] = {name: [] for name in calls}
    seconds, most = effort.seconds / effort.rounds, max(effort.most // effort.rounds, 1)
    collects = gc.isenabled()
    gc.disable()  # its pauses are the interpreter's, not the call's
    try:
        for _ in range(effort.rounds):
            for name, call in calls.items():
                call()
                samples[name] += _timed(call, seconds, most)
    finally:
        if collects:
            gc.enable()
    return {name: np.array(times) / 1000.0 for name, times in samples.items()}


def _timed(call: Callable[[], object], seconds: float, most: int) -> list[int]:
    """[ns] of one or more calls."""
    times: list[int] = []
    now = time.perf_counter_ns()
    end = now + round(1e9 * seconds)
    while not times or (now < end and len(times) < most):
        start = time.perf_counter_ns()
        call()
        now = time.perf_counter_ns()
        times.append(now - start)
    return times


def call_of(inputs: Inputs, algorithm: int, method: str) -> Callable[[], Any]:
    """The call that one cell measures, with all its arguments."""
    if algorithm == 1:
        return partial(
            _core.remove_body, inputs.robot, inputs.q, inputs.origins_W, inputs.points_W,
            inputs.tolerance, method=method,
        )  # fmt: skip
    return partial(_core.closest_pair, inputs.robot, inputs.q, inputs.environment_W, method=method)


def time_cells(grid: Iterable[Inputs], effort: Effort) -> Iterator[TimingCell]:
    """Measures both algorithms by both methods, one call after another on this thread.

    Raises:
        SimulationError: the two methods answer differently.
    """
    for inputs in grid:
        for algorithm in ALGORITHMS:
            calls = {method: call_of(inputs, algorithm, method) for method in METHODS}
            _compare(inputs, algorithm, *(call() for call in calls.values()))
            points = inputs.points_W if algorithm == 1 else inputs.environment_W
            for method, samples_us in measure(calls, effort).items():
                yield TimingCell(
                    robot=inputs.robot.name, vertices=inputs.vertices, cloud=inputs.cloud,
                    points=len(points), algorithm=algorithm, method=method, samples_us=samples_us,
                )  # fmt: skip


def _compare(inputs: Inputs, algorithm: int, paper: Any, fast: Any) -> None:
    same = (
        np.array_equal(paper, fast)
        if algorithm == 1
        else abs(paper.distance - fast.distance) <= SAME_M
    )
    if not same:
        raise SimulationError(
            f"{inputs.robot.name}, {inputs.vertices} vertices, cloud {inputs.cloud}: 'paper' and "
            f"'fast' answer Algorithm {algorithm} differently: {paper!r}, {fast!r}"
        )


def sweep_summary(cells: Sequence[TimingCell], machine: str) -> Summary:
    """Content of the grid's `summary.json`: `machine`, `cells`, `growth`."""
    return {
        "machine": machine,
        "cells": [cell.numbers() for cell in cells],
        "growth": growth(cells),
    }


def growth(cells: Sequence[TimingCell]) -> list[dict[str, Any]]:
    """Fitted exponents with vertices and with points, beside those of the paper's formulas.

    Per robot, algorithm and method: time ~ x^exponent, fitted to the medians over all cells, with
    a factor of its own for each cloud (x the vertices) or each resolution (x the points). `formula`
    is the exponent that the same fit finds in the paper's own cost, (2) or (3), with every constant
    1: linear in the points, logarithmic in the vertices. Null where there are too few cells.
    """
    rows = []
    keys = dict.fromkeys((cell.robot, cell.algorithm, cell.method) for cell in cells)
    for robot, algorithm, method in keys:
        own = [c for c in cells if (c.robot, c.algorithm, c.method) == (robot, algorithm, method)]
        row: dict[str, Any] = {"robot": robot, "algorithm": algorithm, "method": method}
        times = [cell.median_us for cell in own]
        costs = [formula(cell.algorithm, cell.points, cell.vertices) for cell in own]
        for axis, curve in (("vertices", "cloud"), ("points", "vertices")):
            x = [float(getattr(cell, axis)) for cell in own]
            curves = [getattr(cell, curve) for cell in own]
            fitted, cost = fit_growth(x, times, curves), fit_growth(x, costs, curves)
            row[axis] = {**asdict(fitted), "formula": cost.exponent} if fitted and cost else None
        rows.append(row)
    return rows


def formula(algorithm: int, points: int, vertices: int) -> float:
    """Cost by [WA] (2) or (3), every constant 1, for one link: N M log V + N M, and log V more."""
    depth = float(np.log2(vertices))
    return points * depth + points + (depth if algorithm == 2 else 0.0)


@dataclass(frozen=True, slots=True)
class Growth:
    """Exponent of a power law, with the ends of its 95 % interval.

    The ends are None where there are too few values to tell.
    """

    exponent: float
    low: float | None
    high: float | None


def fit_growth(x: Sequence[float], y: Sequence[float], curve: Sequence[Hashable]) -> Growth | None:
    """Least squares of log y = a(curve) + b log x: one exponent b for several curves.

    Args:
        x: what y grows with, above 0.
        y: above 0.
        curve: which curve each value belongs to; each has a factor of its own.

    Returns:
        b, or None where x does not vary within any curve.
    """
    log_x, log_y = np.log(np.asarray(x, np.float64)), np.log(np.asarray(y, np.float64))
    curves = list(dict.fromkeys(curve))
    of = np.array([curves.index(name) for name in curve])
    for row in range(len(curves)):
        log_x[of == row] -= log_x[of == row].mean()
        log_y[of == row] -= log_y[of == row].mean()
    spread = float(log_x @ log_x)
    if spread < 1e-12:
        return None
    exponent = float(log_x @ log_y) / spread
    freedom = len(log_x) - len(curves) - 1
    if freedom < 3:
        return Growth(exponent, None, None)
    residual = log_y - exponent * log_x
    deviation = float(np.sqrt(residual @ residual / freedom / spread))
    half = student_quantile(0.5 + 0.5 * CONFIDENCE, freedom) * deviation
    return Growth(exponent, exponent - half, exponent + half)


def student_quantile(share: float, freedom: int) -> float:
    """Quantile of Student's t, within 1 % at the usual shares from 3 degrees of freedom on.

    Source: Abramowitz and Stegun, 26.7.5: Cornish and Fisher's expansion about the normal one.
    """
    z = NormalDist().inv_cdf(share)
    terms = (
        (z**3 + z) / 4.0,
        (5.0 * z**5 + 16.0 * z**3 + 3.0 * z) / 96.0,
        (3.0 * z**7 + 19.0 * z**5 + 17.0 * z**3 - 15.0 * z) / 384.0,
        (79.0 * z**9 + 776.0 * z**7 + 1482.0 * z**5 - 1920.0 * z**3 - 945.0 * z) / 92160.0,
    )
    return z + math.fsum(term / freedom**power for power, term in enumerate(terms, 1))

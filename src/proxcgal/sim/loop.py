"""The one way through: source -> injected faults -> tick; the caller records."""

import time as clock
from collections.abc import Callable, Iterator
from itertools import count

import numpy as np

from proxcgal import _core
from proxcgal.scene.obstacles import Cloud, FixedCloud
from proxcgal.sim.source import Source
from proxcgal.sim.tick import TickInput, TickResult


def run_ticks(
    source: Source,
    ctrl: _core.Controller,
    faults: Callable[[TickInput], TickInput] | None = None,
    known: Cloud | None = None,
    begin: float = 0.0,
) -> Iterator[tuple[TickInput, TickResult]]:
    """Tick after tick until the source ends; `ctrl` then holds the state after the yielded one.

    Args:
        source: of inputs; it gets each command.
        ctrl: the controller.
        faults: between source and tick, such as a `FaultInjector`.
        known: points of the scene itself, for ticks on those. Asked at the tick's place in the
            run, because a fault may change the caller's clock.
        begin: of the scene, at the first tick [s].
    """
    cloud = FixedCloud(np.empty((0, 3))) if known is None else known
    for tick in count():
        if (inputs := source.read()) is None:
            return
        if faults is not None:
            inputs = faults(inputs)
        scans = list(inputs.scans)
        elapsed = begin + tick * ctrl.config.period
        points_W = cloud(elapsed if inputs.known else 0.0)
        velocity_W = None if cloud.still else cloud.velocities(elapsed)
        start, cpu = clock.perf_counter_ns(), clock.thread_time_ns()
        if inputs.known:
            out = ctrl.tick_known(inputs.time, inputs.q, points_W, inputs.goal, velocity_W)
        else:
            out = ctrl.tick(inputs.time, inputs.q, scans, inputs.goal, inputs.late, inputs.q_stamp)
        cpu_us = (clock.thread_time_ns() - cpu) / 1000.0
        tick_us = (clock.perf_counter_ns() - start) / 1000.0
        result = TickResult.of(out, len(ctrl.cloud_origins()), tick_us, cpu_us)
        source.command(result.qd)
        yield inputs, result

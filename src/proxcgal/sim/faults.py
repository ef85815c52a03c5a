"""Faults put between the sensors and the controller, as the scenario's `[[fault]]` tables say."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from proxcgal import _core
from proxcgal.errors import ConfigError
from proxcgal.sim.ranges import NO_TARGET, VALID, ZONES
from proxcgal.sim.scenario_keys import FAULT_VALUES, Fault

_STREAM = 2  # of the seed; the sensors' noise draws from another


class FaultInjector:
    """Applies every fault, in the file's order, to the scans of one tick after another."""

    def __init__(self, faults: Sequence[Fault], sensors: Sequence[str], seed: int) -> None:
        """Resolves sensors by row, name or "all".

        Args:
            faults: of the scenario.
            sensors: names of the skin's mounts, by row.
            seed: of the run.

        Raises:
            ConfigError: sensors that do not exist, one line each.
        """
        problems = []
        self._faults: list[_Injected] = []
        for place, fault in enumerate(faults):
            rows = _rows(fault.sensor, sensors)
            if rows is None:
                problems.append(
                    f"fault.{place}.sensor = {fault.sensor!r}: unknown; a row from 0 to "
                    f'{len(sensors) - 1}, "all", or one of {", ".join(sensors)}'
                )
            else:
                self._faults.append(_Injected(fault, rows, (seed, _STREAM, place)))
        if problems:
            raise ConfigError("\n".join(problems))

    def __call__(self, time: float, scans: Sequence[_core.Scan]) -> list[_core.Scan]:
        """What the controller gets instead of `scans` at `time` [s]."""
        for fault in self._faults:
            scans = fault.apply(time, scans)
        return list(scans)


class _Injected:
    """One fault with what it remembers."""

    def __init__(self, fault: Fault, rows: frozenset[int], key: tuple[int, ...]) -> None:
        self._kind = fault.kind
        self._start = fault.start
        self._end = np.inf if fault.end is None else fault.end
        usual = FAULT_VALUES.get(fault.kind, ("", 0.0))[1]
        self._value = usual if fault.value is None else fault.value
        self._rows = rows
        self._key = key
        self._last: dict[int, _core.Scan] = {}
        self._waiting: list[_core.Scan] = []

    def apply(self, time: float, scans: Sequence[_core.Scan]) -> list[_core.Scan]:
        out = []
        for scan in scans:
            if scan.sensor not in self._rows or not self._start <= scan.stamp < self._end:
                self._last[scan.sensor] = scan
                out.append(scan)
            elif self._kind == "delay":
                self._waiting.append(scan)
            elif self._kind != "silent":
                out.append(self._spoil(scan))
        due = [scan for scan in self._waiting if scan.stamp + self._value <= time]
        self._waiting = [scan for scan in self._waiting if scan.stamp + self._value > time]
        return out + due

    def _spoil(self, scan: _core.Scan) -> _core.Scan:
        counter, ranges, status = scan.counter, np.array(scan.ranges), np.array(scan.status)
        match self._kind:
            case "frozen" | "stuck_payload":
                last = self._last.setdefault(scan.sensor, scan)
                ranges, status = np.array(last.ranges), np.array(last.status)
                if self._kind == "frozen":
                    counter = last.counter
            case "nan":
                ranges[:], status[:] = np.nan, VALID
            case "zero":
                ranges[:], status[:] = 0.0, VALID
            case "dropout":
                generator = np.random.default_rng([*self._key, scan.sensor, scan.counter])
                lost = generator.random(ZONES) < self._value
                ranges[lost], status[lost] = 0.0, NO_TARGET
            case "offset":
                ranges[status != NO_TARGET] += self._value
        return _core.Scan(scan.sensor, counter, scan.stamp, ranges, status)


def _rows(sensor: int | str, names: Sequence[str]) -> frozenset[int] | None:
    if sensor == "all":
        return frozenset(range(len(names)))
    if isinstance(sensor, int):
        return frozenset([sensor]) if 0 <= sensor < len(names) else None
    return frozenset([names.index(sensor)]) if sensor in names else None

"""Faults of scans, of the tick's other inputs and of mounts, as the `[[fault]]` tables say."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from proxcgal import _core
from proxcgal.core.errors import ConfigError
from proxcgal.core.transforms import rotation_from_vector
from proxcgal.core.typing import Array
from proxcgal.models.robots import Robot
from proxcgal.scenario.fault_keys import FAULT_VALUES, INPUT_FAULTS, MOUNT_FAULTS, Fault
from proxcgal.sim.range_sensor import NO_TARGET, VALID, ZONES
from proxcgal.sim.tick import TickInput

_STREAM, _MOUNT_STREAM = 2, 3  # of the seed; the sensors' noise draws from another


class FaultInjector:
    """Applies every fault, in the file's order, to one tick's inputs after another.

    Faults of scans go by the scans' stamps, the others by the tick's time.
    """

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
        self._inputs = [fault for fault in faults if fault.kind in INPUT_FAULTS]
        for place, fault in enumerate(faults):
            if fault.kind in INPUT_FAULTS:
                continue
            rows = rows_of(fault, sensors)
            if rows is None:
                problems.append(
                    f"fault.{place}.sensor = {fault.sensor!r}: unknown; a row from 0 to "
                    f'{len(sensors) - 1}, "all", or one of {", ".join(sensors)}'
                )
            elif fault.kind not in MOUNT_FAULTS:  # those are the world's
                self._faults.append(_Injected(fault, rows, (seed, _STREAM, place)))
        if problems:
            raise ConfigError("\n".join(problems))

    def __call__(self, inputs: TickInput) -> TickInput:
        """What the controller gets instead of a tick's inputs."""
        scans: Sequence[_core.Scan] = inputs.scans
        for fault in self._faults:
            scans = fault.apply(inputs.time, scans)
        inputs = replace(inputs, scans=tuple(scans))
        for of_input in self._inputs:
            inputs = _spoiled_input(of_input, inputs)
        return inputs


def _spoiled_input(fault: Fault, inputs: TickInput) -> TickInput:
    end = np.inf if fault.end is None else fault.end
    value = value_of(fault)
    if fault.kind == "clock_jump":  # a clock that jumped stays so: `to` jumps back
        shift = value if fault.start <= inputs.time < end else 0.0
        scans = tuple(
            _core.Scan(scan.sensor, scan.counter, scan.stamp + shift, scan.ranges, scan.status)
            for scan in inputs.scans
        )
        return replace(inputs, time=inputs.time + shift, scans=scans if shift else inputs.scans)
    if not fault.start <= inputs.time < end:
        return inputs
    if fault.kind == "joints_old":
        return replace(inputs, q_stamp=inputs.time - value)
    if fault.kind == "joints_nan":
        return replace(inputs, q=np.full_like(inputs.q, np.nan))
    return replace(inputs, late=True)


class _Injected:
    """One fault with what it remembers."""

    def __init__(self, fault: Fault, rows: frozenset[int], key: tuple[int, ...]) -> None:
        self._kind, self._value = fault.kind, value_of(fault)
        self._start, self._end = fault.start, np.inf if fault.end is None else fault.end
        self._rows, self._key = rows, key
        self._last: dict[int, _core.Scan] = {}
        self._waiting: list[_core.Scan] = []
        self._held: dict[int, _core.Scan] = {}

    def apply(self, time: float, scans: Sequence[_core.Scan]) -> list[_core.Scan]:
        out = []
        for scan in scans:
            if scan.sensor not in self._rows or not self._start <= scan.stamp < self._end:
                self._last[scan.sensor] = scan
                out.append(scan)
            elif self._kind == "delay":
                self._waiting.append(scan)
            elif self._kind == "swapped":
                earlier = self._held.pop(scan.sensor, None)
                if earlier is None:
                    self._held[scan.sensor] = scan
                else:
                    out += [scan, earlier]
            elif self._kind != "silent":
                out.append(self._spoil(scan))
                if self._kind == "duplicate":
                    out.append(out[-1])
        due = [scan for scan in self._waiting if scan.stamp + self._value <= time]
        self._waiting = [scan for scan in self._waiting if scan.stamp + self._value > time]
        return out + due

    def _spoil(self, scan: _core.Scan) -> _core.Scan:
        counter, stamp = scan.counter, scan.stamp
        ranges, status = np.array(scan.ranges), np.array(scan.status)
        match self._kind:
            case "frozen" | "stuck_payload":
                last = self._last.setdefault(scan.sensor, scan)
                ranges, status = np.array(last.ranges), np.array(last.status)
                if self._kind == "frozen":
                    counter = last.counter
            case "nan":
                ranges[:], status[:] = np.nan, VALID
            case "infinite":
                ranges[:], status[:] = np.inf, VALID
            case "negative":
                ranges[:], status[:] = -0.1, VALID
            case "zero":
                ranges[:], status[:] = 0.0, VALID
            case "status":
                status[:] = int(self._value)
            case "stamp_offset":
                stamp += self._value
            case "dropout":
                generator = np.random.default_rng([*self._key, scan.sensor, scan.counter])
                lost = generator.random(ZONES) < self._value
                ranges[lost], status[lost] = 0.0, NO_TARGET
            case "offset":
                ranges[status != NO_TARGET] += self._value
        return _core.Scan(scan.sensor, counter, stamp, ranges, status)


def value_of(fault: Fault) -> float:
    """The fault's value, or what it is where the file leaves it out."""
    usual = FAULT_VALUES[fault.kind].default if fault.kind in FAULT_VALUES else 0.0
    return usual if fault.value is None else fault.value


def rows_of(fault: Fault, names: Sequence[str]) -> frozenset[int] | None:
    """Rows of the skin that a fault hits; None where there is no such sensor."""
    sensor = fault.sensor
    if sensor == "all":
        return frozenset(range(len(names)))
    if isinstance(sensor, int):
        return frozenset([sensor]) if 0 <= sensor < len(names) else None
    return frozenset([names.index(sensor)]) if sensor in names else None


class RealMounts:
    """The sensors' mounts in the world, which `mount_` faults move from where they should be."""

    def __init__(
        self,
        robot: Robot,
        mounts: Sequence[_core.Mount],
        faults: Sequence[Fault] = (),
        seed: int = 0,
    ) -> None:
        """Resolves the faults.

        Args:
            robot: that carries the sensors.
            mounts: as the controller has them.
            faults: of the scenario, whatever kind.
            seed: of the run.
        """
        self._robot, links = robot, list(robot.link_names)
        self._links = np.array([links.index(mount.link) for mount in mounts], np.intp)
        self._T_LS: Array = np.array([mount.T_LS for mount in mounts]).reshape(-1, 4, 4)
        names = [mount.name for mount in mounts]
        self._moved: list[tuple[Fault, int, Array]] = []
        for place, fault in enumerate(faults):
            if fault.kind not in MOUNT_FAULTS:
                continue
            for row in sorted(rows_of(fault, names) or ()):
                drawn = np.random.default_rng([seed, _MOUNT_STREAM, place, row]).standard_normal(3)
                axis = np.eye(3)["xyz".index(fault.axis)] if fault.axis else drawn
                by = value_of(fault) * axis / np.linalg.norm(axis)
                T_SS = np.eye(4)
                if fault.kind == "mount_offset":
                    T_SS[:3, 3] = by
                else:
                    T_SS[:3, :3] = rotation_from_vector(by)
                self._moved.append((fault, row, T_SS))

    def poses_W(  # noqa: N802  a frame's suffix
        self, q: Array, time: float, rows: Sequence[int] | slice = slice(None)
    ) -> Array:
        """(k, 4, 4) T_WS of these sensors at a posture (n_q,) and a time of the run [s]."""
        return np.asarray(self._robot.link_poses(q)[self._links[rows]] @ self.at(time)[rows])

    def at(self, time: float) -> Array:
        """(n, 4, 4) T_LS of every sensor at that time of the run."""
        if not self._moved:
            return self._T_LS
        T_LS = self._T_LS.copy()
        for fault, row, T_SS in self._moved:
            if fault.start <= time and (fault.end is None or time < fault.end):
                T_LS[row] = T_LS[row] @ T_SS
        return T_LS

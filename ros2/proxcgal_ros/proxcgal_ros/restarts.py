"""Sensors that were switched off and on count from the beginning again."""

from __future__ import annotations

from dataclasses import dataclass

_MODULUS = 2**32


@dataclass(slots=True)
class _Told:
    raw: int  # last counter as it came
    inputs: int  # last counter that was passed on as new
    offset: int
    received: float  # [s] of that
    stamp: float  # [s]
    refused: int | None = None  # last one since that was not new


class Restarts:
    """Counters as the controller takes them: they go on where a sensor began anew.

    Only after a silence that has held the arm already, and only where the counter advances: a
    frozen sensor, a repeated and an overtaken packet stay what they are.
    """

    def __init__(self, silent_after: float) -> None:
        """Args: [s] without anything new, before a restart is believed."""
        self._silent_after = silent_after
        self._told: dict[int, _Told] = {}

    def counter(self, row: int, raw: int, stamp: float, now: float) -> int:
        """What to pass on.

        Args:
            row: of the skin.
            raw: counter as it came.
            stamp: [s] of the scan.
            now: [s] of its receipt, on the same clock.
        """
        told = self._told.get(row)
        if told is None:
            self._told[row] = _Told(raw, raw, 0, now, stamp)
            return raw
        inputs = (raw + told.offset) % _MODULUS
        if not _newer(inputs, told.inputs):
            advances = told.refused is not None and _newer(raw, told.refused)
            told.refused = raw
            silent = now - told.received > self._silent_after
            if not (advances and silent and raw != told.raw and stamp > told.stamp):
                return inputs
            told.offset = (told.inputs + 1 - raw) % _MODULUS
            inputs = (raw + told.offset) % _MODULUS
        told.raw, told.inputs, told.received, told.stamp = raw, inputs, now, stamp
        told.refused = None
        return inputs


def _newer(counter: int, than: int) -> bool:
    return 0 < (counter - than) % _MODULUS < _MODULUS // 2

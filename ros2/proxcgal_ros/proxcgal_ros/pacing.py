"""How often what people look at is told: at a rate at most, clouds with what was measured."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

PATIENCE = 1.25  # of the clouds' period
EARLY = 0.25  # of a period: what comes at its rate, but not evenly, is not left out


class Pace:
    """One display's turns: at its rate at most in the long run, each a little early or late."""

    def __init__(self, hz: float) -> None:
        """Args: [1/s] at most."""
        self.set(hz)
        self._last = -np.inf

    def set(self, hz: float) -> None:
        """Another rate [1/s] from now on."""
        self._hz, self._due = hz, -np.inf

    def due(self, time: float) -> bool:
        """Is it its turn at this time [s]? Then it is taken."""
        period = 1.0 / self._hz
        if time < self._due - EARLY * period:
            return False
        if time < self._due + period:
            self._due = max(self._due + period, time + (1.0 - EARLY) * period)
        else:
            self._due = time + period
        self._last = time
        return True

    def since(self, time: float) -> float:
        """Periods since the last turn."""
        return (time - self._last) * self._hz


class CloudPace(Pace):
    """Clouds come once all arrays have told something new; one that is late is not waited for."""

    def __init__(self, hz: float) -> None:
        """Args: [1/s] at most."""
        super().__init__(hz)
        self.newest_ns = 0  #: stamp of the newest scan in the last cloud

    def due_with(self, time: float, stamps_ns: Mapping[str, int]) -> bool:
        """Is it a cloud's turn? Then it is taken.

        Args:
            time: [s].
            stamps_ns: of the newest scan of each array that has told any.
        """
        new = [stamp > self.newest_ns for stamp in stamps_ns.values()]
        patient = self.since(time) < PATIENCE
        if not any(new) or (patient and not all(new)) or not self.due(time):
            return False
        self.newest_ns = max(stamps_ns.values())
        return True

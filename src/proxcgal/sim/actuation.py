"""The arm's motion between two ticks: it follows its velocity commands exactly."""

import numpy as np

from proxcgal.core.typing import Array


class Actuation:
    """An arm without inertia: each command is its velocity for one period."""

    def __init__(self, q0: Array, period: float) -> None:
        """At rest.

        Args:
            q0: (n_q,) [rad] or [m].
            period: [s] from tick to tick.
        """
        self._period = period
        self._before = self.q = np.array(q0, np.float64)  #: (n_q,) at the last tick
        self.qd: Array = np.zeros_like(self.q)  #: (n_q,) commanded last

    def step(self) -> None:
        """Moves by the last command, for one period."""
        self._before, self.q = self.q, self.q + self.qd * self._period

    def within_step(self, since: float) -> Array:
        """(n_q,) posture during the last step, `since` its beginning [s]."""
        return self._before + self.qd * since

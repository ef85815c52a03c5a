"""Where the tool is sent, tick by tick: one goal, or way points back and forth."""

from collections.abc import Sequence

import numpy as np

from proxcgal.core.typing import Array


class Waypoints:
    """The goal that is due; the next one on arrival, or when patience has run out."""

    def __init__(self, goals: Sequence[Array], arrival: float, patience: float) -> None:
        """Begins with the first goal.

        Args:
            goals: (4, 4) T_WT each, at least one.
            arrival: distance to a goal's position at which the next one is due [m].
            patience: time after which the next goal is due in any case [s].
        """
        there = list(range(len(goals)))
        self._goals = goals
        self._order = there + there[-2:0:-1]  # 0 1 2 1, and again
        self._arrival = arrival
        self._patience = patience
        self._place = 0
        self._since = 0.0

    def at(self, time: float, tool_W: Array) -> Array:
        """(4, 4) T_WT of the goal that is due.

        Args:
            time: of this tick, not before the last one's [s].
            tool_W: (3,) [m].
        """
        goal = self._goals[self._order[self._place]]
        if len(self._goals) > 1:
            there = np.linalg.norm(goal[:3, 3] - tool_W) <= self._arrival
            if there or time - self._since >= self._patience - 1e-9:
                self._place = (self._place + 1) % len(self._order)
                self._since = time
                goal = self._goals[self._order[self._place]]
        return goal

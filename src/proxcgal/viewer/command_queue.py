"""What pages want, collected until the simulation is told: the last word on each thing counts."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np

from proxcgal.core.typing import Array
from proxcgal.viewer.messages import Request

#: Where a solid may be put, least and most of x, y, z [m].
ROOM = np.array([[-5.0, -5.0, -1.5], [5.0, 5.0, 4.0]])


class CommandQueue:
    """Any thread may put something on it."""

    def __init__(self) -> None:
        """Empty."""
        self._lock = threading.Lock()
        self._wanted: dict[str, Any] = {}
        self._hands: dict[str, Array] = {}

    def want(self, **wanted: Any) -> None:
        """Fields of `Wishes`; `steps` add up."""
        with self._lock:
            wanted["steps"] = wanted.get("steps", 0) + self._wanted.get("steps", 0)
            self._wanted |= wanted
            if wanted.get("release") or wanted.get("reset") or wanted.get("anew"):
                self._hands.clear()

    def move(self, name: str, T_WO: Array) -> None:
        """Where a solid is to go, within the room."""
        pose = np.array(T_WO)
        pose[:3, 3] = np.clip(pose[:3, 3], *ROOM)
        with self._lock:
            self._hands[name] = pose

    def take(self) -> Request | None:
        """All that lies here; None where nothing does."""
        with self._lock:
            if not self._wanted and not self._hands:
                return None
            request = Request(**self._wanted, hands=tuple(self._hands.items()))
            self._wanted, self._hands = {}, {}
            return request

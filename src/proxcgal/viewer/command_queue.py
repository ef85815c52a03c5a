"""Commands of pages, collected until they are sent: the latest value per key counts."""

import threading
from typing import Any

import numpy as np

from proxcgal.core.typing import Array
from proxcgal.viewer.messages import Request

#: Where a solid may be put, least and most of x, y, z [m].
ROOM = np.array([[-5.0, -5.0, -1.5], [5.0, 5.0, 4.0]])


class CommandQueue:
    """Keeps only the latest value per key; any thread may put values."""

    def __init__(self) -> None:
        """Empty."""
        self._lock = threading.Lock()
        self._fields: dict[str, Any] = {}
        self._moves: dict[str, Array] = {}

    def put(self, **fields: Any) -> None:
        """Sets fields of the next `Request`; `steps` add up."""
        with self._lock:
            fields["steps"] = fields.get("steps", 0) + self._fields.get("steps", 0)
            self._fields |= fields
            if fields.get("release") or fields.get("reset") or fields.get("restart"):
                self._moves.clear()

    def move(self, name: str, T_WO: Array) -> None:
        """Sets where a solid is to go, (4, 4) T_WO, within the room."""
        pose = np.array(T_WO)
        pose[:3, 3] = np.clip(pose[:3, 3], *ROOM)
        with self._lock:
            self._moves[name] = pose

    def take(self) -> Request | None:
        """Empties the queue; None where it is empty."""
        with self._lock:
            if not self._fields and not self._moves:
                return None
            request = Request(**self._fields, moves=tuple(self._moves.items()))
            self._fields, self._moves = {}, {}
            return request

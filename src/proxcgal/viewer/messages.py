"""Messages between a page and its simulation, and the queue in which they wait."""

import contextlib
import threading
from collections import deque
from dataclasses import dataclass
from multiprocessing.connection import Connection

from proxcgal.core.typing import Array
from proxcgal.sim.moment import Posed
from proxcgal.viewer.choice import Choice
from proxcgal.viewer.scene_model import SceneModel


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """Commands of a page since its last request; None: unchanged."""

    running: bool | None = None
    steps: int = 0  #: ticks, while it does not run
    reset: bool = False  #: the arm back to its start, the time to 0
    moves: tuple[tuple[str, Array], ...] = ()  #: (4, 4) T_WO that each of these solids is to go to
    release: bool = False  #: all solids
    silent: frozenset[int] | None = None  #: rows of the sensors that give no scans
    choice: Choice | None = None
    enable: bool = False  #: press the reset of a walk-through's guard
    restart: bool = False  #: as `reset`, out of a STOP too: never from a message of a page


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Update:
    """State of the simulation, for a page."""

    moment: Posed | None = None
    model: SceneModel | None = None  #: where it is another one
    choice: Choice | None = None  #: with the model: what it was made with
    refused: bool = False  #: with the choice: another one was requested and does not fit
    note: str = ""  #: what could not be done, or is being done
    late_us: tuple[float, float] = (0.0, 0.0)  #: of the last ticks' wake-ups: median and p99
    cpu_us: float = 0.0  #: median thread CPU of the last ticks
    real_time: float = 1.0  #: simulated seconds in one
    dropped: int = 0  #: moments that the page did not take, so far
    running: bool = True
    failed: str = ""  #: why the simulation has ended


class Outbox:
    """Sends the newest moment, one at a time, and all notes and models, in a thread of its own."""

    def __init__(self, link: Connection) -> None:
        """Args: `link` to the page."""
        self._link = link
        self._wake = threading.Condition()
        self._certain: deque[Update] = deque()
        self._newest: Update | None = None
        self._free = True  # the page has taken the last moment
        self._closed = False
        self.dropped = 0
        self._thread = threading.Thread(target=self._send, daemon=True)
        self._thread.start()

    def offer(self, update: Update) -> None:
        """Replaces a moment that is not sent yet."""
        with self._wake:
            self.dropped += self._newest is not None
            self._newest = update
            self._wake.notify()

    def send(self, update: Update) -> None:
        """Sends it in any case."""
        with self._wake:
            self._certain.append(update)
            self._newest = None  # older than this one
            self._wake.notify()

    def acknowledge(self) -> None:
        """The page has drawn the last moment."""
        with self._wake:
            self._free = True
            self._wake.notify()

    def close(self) -> None:
        """Sends what is left, and ends the thread."""
        with self._wake:
            self._closed = True
            self._wake.notify()
        self._thread.join(timeout=2.0)

    def _send(self) -> None:
        with contextlib.suppress(OSError, EOFError):
            while True:
                with self._wake:
                    self._wake.wait_for(
                        lambda: self._certain or self._closed or (self._free and self._newest)
                    )
                    if self._certain:
                        update: Update | None = self._certain.popleft()
                    elif self._closed:
                        return
                    else:
                        update, self._newest, self._free = self._newest, None, False
                self._link.send(update)

"""The simulation beside a page, in a process of its own: real time, whatever the page does.

Towards the page goes at most one moment at a time; what is not fetched is dropped. A thread sends
it, so that a tick never waits for a page. From the page come wishes; none of them leads out of a
STOP: only whoever started the command begins anew then.
"""

from __future__ import annotations

import contextlib
import threading
import time as clock
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from multiprocessing.connection import Connection

import numpy as np
from numpy.typing import NDArray

from proxcgal.apps.view.choice import Choice
from proxcgal.apps.view.stage import Stage
from proxcgal.errors import ProxError
from proxcgal.sim.live import LiveTrial
from proxcgal.sim.moment import Moment
from proxcgal.sim.scenario import Scenario

Array = NDArray[np.float64]

FRAME_HZ = 15.0  #: moments that are offered to the page
LOST = 0.1  #: [s] behind real time from which what is lost stays lost
_LATENESS = 1000  # ticks that the lateness is told of


@dataclass(frozen=True, slots=True, kw_only=True)
class Wishes:
    """What a page wants since it last spoke; what it does not want anew is None."""

    running: bool | None = None
    steps: int = 0  #: ticks, while it does not run
    reset: bool = False  #: the arm back to its start, the time to 0
    hands: tuple[tuple[str, Array], ...] = ()  #: (4, 4) T_WO that each of these solids is to go to
    release: bool = False  #: all solids
    off: frozenset[int] | None = None  #: rows of the sensors that are silent
    choice: Choice | None = None
    anew: bool = False  #: as `reset`, out of a STOP too: never from a message of a page


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Told:
    """What the simulation tells a page."""

    moment: Moment | None = None
    stage: Stage | None = None  #: where it is another one
    choice: Choice | None = None  #: with the stage: what it was made with
    refused: bool = False  #: with the choice: another one was wanted, and could not be
    note: str = ""  #: what could not be done, or is being done
    late_us: tuple[float, float] = (0.0, 0.0)  #: of the last ticks' wake-ups: median and p99
    cpu_us: float = 0.0  #: median thread CPU of the last ticks
    real_time: float = 1.0  #: simulated seconds in one
    dropped: int = 0  #: moments that the page did not take, so far
    running: bool = True
    failed: str = ""  #: why the simulation has ended


def simulate(link: Connection, scenario: Scenario, controller: str, hz: float = FRAME_HZ) -> None:
    """Runs until the other end of `link` is closed; the target of a process."""
    outbox = _Outbox(link)
    try:
        _Simulation(outbox, link, scenario, controller, hz).run()
    except (EOFError, BrokenPipeError, ConnectionResetError, KeyboardInterrupt):
        pass
    except ProxError as error:
        outbox.tell(Told(failed=str(error)))
    except Exception as error:  # the page is to say so, not to stand still
        outbox.tell(Told(failed=f"{type(error).__name__}: {error}"))
        raise
    finally:
        outbox.close()


class _Outbox:
    """One moment at a time, the newest; notes and stages all. Sent by a thread of its own."""

    def __init__(self, link: Connection) -> None:
        self._link = link
        self._wake = threading.Condition()
        self._sure: deque[Told] = deque()
        self._newest: Told | None = None
        self._free = True  # the page has taken the last moment
        self._closed = False
        self.dropped = 0
        self._thread = threading.Thread(target=self._send, daemon=True)
        self._thread.start()

    def offer(self, told: Told) -> None:
        """Takes the place of what was not sent yet."""
        with self._wake:
            self.dropped += self._newest is not None
            self._newest = told
            self._wake.notify()

    def tell(self, told: Told) -> None:
        """Sent whatever happens."""
        with self._wake:
            self._sure.append(told)
            self._newest = None  # older than what is told now
            self._wake.notify()

    def taken(self) -> None:
        """The page has drawn what it got."""
        with self._wake:
            self._free = True
            self._wake.notify()

    def close(self) -> None:
        """What was told is sent, nothing after it, and the thread ends."""
        with self._wake:
            self._closed = True
            self._wake.notify()
        self._thread.join(timeout=2.0)

    def _send(self) -> None:
        with contextlib.suppress(OSError, EOFError):
            while True:
                with self._wake:
                    self._wake.wait_for(
                        lambda: self._sure or self._closed or (self._free and self._newest)
                    )
                    if self._sure:
                        told: Told | None = self._sure.popleft()
                    elif self._closed:
                        return
                    else:
                        told, self._newest, self._free = self._newest, None, False
                self._link.send(told)


class _Simulation:
    """The loop."""

    def __init__(
        self, outbox: _Outbox, link: Connection, scenario: Scenario, controller: str, hz: float
    ) -> None:
        self._outbox = outbox
        self._link = link
        self._base = scenario
        self._choice = Choice.of(scenario, controller)
        self._frame = 1.0 / hz
        self._off: frozenset[int] = frozenset()
        self._running = True
        self._trial = LiveTrial(scenario, controller)
        self._fresh()
        self._stage()

    def run(self) -> None:
        """Tick after tick, each when it is due."""
        due = begin = clock.monotonic()
        frame_due, simulated, shown = begin, 0.0, -1.0
        while True:
            steps = 0
            for wishes in self._received(wait=0.0 if self._running else 0.02):
                steps += self._grant(wishes)
            now = clock.monotonic()
            if not self._running and steps == 0:
                due = begin = now
                simulated = 0.0
                if shown != self._trial.elapsed or now >= frame_due + 1.0:
                    frame_due = now
                    shown = self._trial.elapsed
                    self._show(1.0)
                continue
            for _ in range(max(steps, 1)):
                self._tick(max(now - due, 0.0) if self._running else None)
            simulated += self._trial.period
            if now >= frame_due or not self._running:
                frame_due = max(frame_due + self._frame, now)
                shown = self._trial.elapsed
                self._show(min(simulated / max(clock.monotonic() - begin, 1e-6), 1.0))
                if clock.monotonic() - begin > 2.0:
                    begin, simulated = clock.monotonic(), 0.0
            due = max(due + self._trial.period, clock.monotonic() - LOST)
            clock.sleep(max(due - clock.monotonic(), 0.0))

    def _received(self, wait: float) -> Iterable[Wishes]:
        while self._link.poll(wait):
            wait = 0.0
            message = self._link.recv()
            if message is None:
                self._outbox.taken()
            else:
                yield message

    def _grant(self, wishes: Wishes) -> int:
        """Does what is wanted; how many single ticks are still to be made."""
        stopped = self._trial.stopped
        if wishes.anew or (wishes.reset and not stopped):
            self._anew(self._choice, keep=False)
        elif wishes.reset or (wishes.choice is not None and stopped):
            self._note("the controller has stopped: only a reset where `proxcgal view` runs helps")
        if wishes.choice is not None and not stopped and wishes.choice != self._choice:
            try:
                self._anew(wishes.choice, keep=wishes.choice.robot == self._choice.robot)
                self._choice = wishes.choice
                self._stage()
            except ProxError as error:
                self._note(str(error))
                self._stage(refused=True)
        if wishes.running is not None:
            self._running = wishes.running
        if wishes.release:
            self._trial.hands.release()
        for name, pose in wishes.hands:
            self._trial.move(name, pose)
        if wishes.off is not None:
            self._off = self._trial.off = wishes.off
        return 0 if self._running else min(wishes.steps, 100)

    def _anew(self, choice: Choice, *, keep: bool) -> None:
        """Another trial, at rest; `keep`: where the arm is, at the same time."""
        old = self._trial
        scenario = choice.applied(self._base)
        same = (choice.robot, choice.vertices) == (self._choice.robot, self._choice.vertices)
        self._trial = LiveTrial(
            scenario, choice.controller, robot=old.setup.robot if same else None,
            q=old.q if keep else None, hands=old.hands if keep else None,
            since=old.elapsed if keep else 0.0,
        )  # fmt: skip
        if choice.robot != self._choice.robot:
            self._off = frozenset()
        self._trial.off = self._off
        self._fresh()

    def _fresh(self) -> None:
        self._late: deque[float] = deque(maxlen=_LATENESS)
        self._cpu: deque[float] = deque(maxlen=_LATENESS)
        self._trial.step()

    def _tick(self, late: float | None) -> None:
        if late is not None:
            self._late.append(1e6 * late)
        self._cpu.append(self._trial.step().cpu_us)

    def _show(self, real_time: float) -> None:
        late = np.array(self._late or [0.0])
        self._outbox.offer(
            Told(
                moment=self._trial.moment(),
                late_us=(float(np.median(late)), float(np.percentile(late, 99))),
                cpu_us=float(np.median(self._cpu or [0.0])),
                real_time=real_time, dropped=self._outbox.dropped, running=self._running,
            )
        )  # fmt: skip

    def _stage(self, *, refused: bool = False) -> None:
        stage = Stage.of(self._trial.setup)
        self._outbox.tell(
            Told(stage=stage, choice=self._choice, running=self._running, refused=refused)
        )

    def _note(self, text: str) -> None:
        self._outbox.tell(Told(note=text, running=self._running))

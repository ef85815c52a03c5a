"""The simulation beside a page, in a process of its own: real time, whatever the page does.

At most one moment at a time goes to the page; what is not fetched is dropped. A thread sends it, so
that a tick never waits for a page. No request of a page leads out of a STOP: only the terminal that
runs the command restarts then.
"""

import time as clock
import warnings
from collections import deque
from collections.abc import Iterable
from multiprocessing.connection import Connection

import numpy as np

from proxcgal.core.errors import ModelWarning, ProxError
from proxcgal.scenario.scenario import Scenario
from proxcgal.scenario.walkthrough_scenario import WalkScenario
from proxcgal.trial.interactive import LiveTrial
from proxcgal.trial.walkthrough.interactive import WalkTrial
from proxcgal.viewer.choice import Choice
from proxcgal.viewer.messages import Outbox, Request, Update
from proxcgal.viewer.scene_model import SceneModel

FRAME_HZ = 15.0  #: moments that are offered to the page
LOST = 0.1  #: [s] behind real time from which what is lost stays lost
_LATENESS = 1000  # ticks whose lateness is reported


def run_simulation(
    link: Connection, scenario: Scenario, controller: str, hz: float = FRAME_HZ
) -> None:
    """Runs until the other end of `link` is closed; the target of a process."""
    outbox = Outbox(link)
    warnings.simplefilter("ignore", ModelWarning)  # the command's own process has warned
    try:
        _Simulation(outbox, link, scenario, controller, hz).run()
    except (EOFError, BrokenPipeError, ConnectionResetError, KeyboardInterrupt):
        pass
    except ProxError as error:
        outbox.send(Update(failed=str(error)))
    except Exception as error:  # the page is to say so, not to stand still
        outbox.send(Update(failed=f"{type(error).__name__}: {error}"))
        raise
    finally:
        outbox.close()


class _Simulation:
    """The loop."""

    def __init__(
        self, outbox: Outbox, link: Connection, scenario: Scenario, controller: str, hz: float
    ) -> None:
        self._outbox = outbox
        self._link = link
        self._base = scenario
        self._choice = (
            None if isinstance(scenario, WalkScenario) else Choice.of(scenario, controller)
        )
        self._frame = 1.0 / hz
        self._silent: frozenset[int] = frozenset()
        self._running = True
        self._trial: LiveTrial | WalkTrial = (
            WalkTrial(scenario)
            if isinstance(scenario, WalkScenario)
            else LiveTrial(scenario, controller)
        )
        self._first_step()
        self._send_model()

    def run(self) -> None:
        """Tick after tick, each when it is due."""
        due = begin = clock.monotonic()
        frame_due, simulated, shown = begin, 0.0, -1.0
        while True:
            steps = 0
            for request in self._received(wait=0.0 if self._running else 0.02):
                steps += self._apply(request)
            now = clock.monotonic()
            if not self._running and steps == 0:
                due = begin = now
                simulated = 0.0
                if shown != self._trial.elapsed or now >= frame_due + 1.0:
                    frame_due = now
                    shown = self._trial.elapsed
                    self._offer_moment(1.0)
                continue
            for _ in range(max(steps, 1)):
                self._tick(max(now - due, 0.0) if self._running else None)
            simulated += self._trial.period
            if now >= frame_due or not self._running:
                frame_due = max(frame_due + self._frame, now)
                shown = self._trial.elapsed
                self._offer_moment(min(simulated / max(clock.monotonic() - begin, 1e-6), 1.0))
                if clock.monotonic() - begin > 2.0:
                    begin, simulated = clock.monotonic(), 0.0
            due = max(due + self._trial.period, clock.monotonic() - LOST)
            clock.sleep(max(due - clock.monotonic(), 0.0))

    def _received(self, wait: float) -> Iterable[Request]:
        while self._link.poll(wait):
            wait = 0.0
            message = self._link.recv()
            if message is None:
                self._outbox.acknowledge()
            else:
                yield message

    def _apply(self, request: Request) -> int:
        """Carries a request out; the number of single ticks that are still to be made."""
        stopped = self._trial.stopped
        if request.restart or (request.reset and not stopped):
            self._restart()
        elif request.reset or (request.choice is not None and stopped):
            reason = "the controller has stopped"
            if isinstance(self._trial, WalkTrial):
                reason = "a stop took longer than the guard declares"
            self._send_note(f"{reason}: only Enter where `proxcgal view` runs leads out of it")
        if request.choice is not None and not stopped and request.choice != self._choice:
            self._choose(request.choice)
        if request.running is not None:
            self._running = request.running
        if request.release:
            self._trial.release()
        for name, pose in request.moves:
            self._trial.move(name, pose)
        if request.silent is not None:
            self._silent = request.silent
            if isinstance(self._trial, LiveTrial):
                self._trial.off = request.silent
        if request.enable and isinstance(self._trial, WalkTrial):
            self._trial.enable()
        return 0 if self._running else min(request.steps, 100)

    def _restart(self) -> None:
        """The arm at its start, the time at 0."""
        old = self._trial
        if isinstance(old, WalkTrial):
            self._trial = old.again()
        else:
            assert self._choice is not None
            scenario = self._choice.applied(self._base)
            self._trial = LiveTrial(scenario, self._choice.controller, robot=old.setup.robot)
            self._trial.off = self._silent
        self._first_step()

    def _choose(self, choice: Choice) -> None:
        """Another controller or robot, at rest: where the arm is, where that is the same robot."""
        old, own = self._trial, self._choice
        if not isinstance(old, LiveTrial) or own is None:
            return
        same = (choice.robot, choice.vertices) == (own.robot, own.vertices)
        keep = choice.robot == own.robot
        try:
            self._trial = LiveTrial(
                choice.applied(self._base), choice.controller,
                robot=old.setup.robot if same else None, q=old.q if keep else None,
                hands=old.hands if keep else None, since=old.elapsed if keep else 0.0,
            )  # fmt: skip
        except ProxError as error:
            self._send_note(str(error))
            self._send_model(refused=True)
            return
        if not keep:
            self._silent = frozenset()
        self._trial.off = self._silent
        self._choice = choice
        self._first_step()
        self._send_model()

    def _first_step(self) -> None:
        self._late: deque[float] = deque(maxlen=_LATENESS)
        self._cpu: deque[float] = deque(maxlen=_LATENESS)
        self._trial.step()

    def _tick(self, late: float | None) -> None:
        if late is not None:
            self._late.append(1e6 * late)
        self._trial.step()
        self._cpu.append(self._trial.cpu_us)

    def _offer_moment(self, real_time: float) -> None:
        late = np.array(self._late or [0.0])
        self._outbox.offer(
            Update(
                moment=self._trial.moment(),
                late_us=(float(np.median(late)), float(np.percentile(late, 99))),
                cpu_us=float(np.median(self._cpu or [0.0])),
                real_time=real_time, dropped=self._outbox.dropped, running=self._running,
            )
        )  # fmt: skip

    def _send_model(self, *, refused: bool = False) -> None:
        trial = self._trial
        model = (
            SceneModel.of_walk(trial)
            if isinstance(trial, WalkTrial)
            else SceneModel.of(trial.setup)
        )
        self._outbox.send(
            Update(model=model, choice=self._choice, running=self._running, refused=refused)
        )

    def _send_note(self, text: str) -> None:
        self._outbox.send(Update(note=text, running=self._running))

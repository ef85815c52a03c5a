"""The live page: draws what the simulation tells, tells it what pages want."""

from __future__ import annotations

import multiprocessing
import threading
import time as clock
from dataclasses import replace
from multiprocessing.connection import Connection

import viser

from proxcgal.core.errors import SimulationError
from proxcgal.scenario.scenario import Scenario
from proxcgal.viewer.access import Gate
from proxcgal.viewer.command_queue import CommandQueue
from proxcgal.viewer.controls import Controls
from proxcgal.viewer.drawing import Drawing, furnish
from proxcgal.viewer.messages import Update
from proxcgal.viewer.preparation import Preparation
from proxcgal.viewer.simulation import FRAME_HZ, is_walk, simulate
from proxcgal.viewer.walkthrough_panel import WalkPanel

PLOT_HZ = 4.0
WORD_HZ = 20.0  #: how often the simulation is told of wishes, at most
_NOTED = 6.0  # [s] that a note stays


class LivePage:
    """One simulation and the pages that look at it."""

    def __init__(
        self,
        server: viser.ViserServer,
        gate: Gate,
        scenario: Scenario,
        controller: str,
        hz: float = FRAME_HZ,
    ) -> None:
        """Starts the simulation in a process of its own.

        Args:
            server: behind its gate.
            gate: of the server.
            scenario: what to run.
            controller: one of CONTROLLERS.
            hz: moments drawn a second.
        """
        self.queue = CommandQueue()
        self.told = Update()  #: the last moment that was drawn
        self.drawn = 0  #: moments so far
        self.bounds = (0.0, 0.0)  #: d_min and buffer of the law [m]
        self._server = server
        self._controls: Controls | WalkPanel = (
            WalkPanel(server, gate, self.queue, scenario)
            if is_walk(scenario)
            else Controls(server, gate, self.queue, scenario, controller)
        )
        self._drawing: Drawing | None = None
        self._shown: tuple[object, ...] = ()
        self._note, self._noted = "", 0.0
        self._plotted = 0.0
        self._waiting = True  # for the first stage: it takes no wishes before
        self._staged = threading.Event()  # that came, or never will
        self._preparation = Preparation(scenario)
        self._closing = threading.Event()
        self.failure: str | None = None  #: why the simulation ended, where it did by itself
        context = multiprocessing.get_context("spawn")
        self._link, theirs = context.Pipe()
        self._process = context.Process(
            target=simulate, args=(theirs, scenario, controller, hz), daemon=True
        )
        self._process.start()
        theirs.close()
        self._thread = threading.Thread(target=self._pump, daemon=True)
        self._thread.start()

    def wait_for_scene(self) -> None:
        """Until there is something to see.

        Raises:
            SimulationError: the simulation failed before that, with the reason.
        """
        self._staged.wait()
        if self._drawing is None and self.failure is not None:
            raise SimulationError(self.failure)

    def wait(self, timeout: float | None = None) -> bool:
        """Until the simulation has ended; true where it has.

        Raises:
            SimulationError: it failed, with the reason.
        """
        self._thread.join(timeout)
        if self.failure is not None and not self._closing.is_set():
            raise SimulationError(self.failure)
        return not self._thread.is_alive()

    def close(self) -> None:
        """Ends the simulation."""
        self._closing.set()
        self._thread.join(timeout=2.0)
        self._preparation.close()
        self._link.close()
        self._process.join(timeout=2.0)
        if self._process.is_alive():
            self._process.terminate()
            self._process.join(timeout=2.0)

    def _pump(self) -> None:
        try:
            self._exchange(self._link)
        except (EOFError, OSError):
            self.failure = self.failure or "the simulation's process has ended"
        finally:
            self._staged.set()

    def _exchange(self, link: Connection) -> None:
        spoken = 0.0
        while not self._closing.is_set() and self.failure is None:
            if link.poll(0.5 / WORD_HZ):
                told = link.recv()
                with self._server.atomic():
                    self._take(told)
                if told.moment is not None:
                    link.send(None)
            now = clock.monotonic()
            if not self._waiting and now >= spoken + 1.0 / WORD_HZ:
                spoken = now
                if (choice := self._preparation.done()) is not None:
                    self.queue.want(choice=choice)
                if (request := self.queue.take()) is not None:
                    if request.choice is not None:
                        request = replace(request, choice=self._preparation.asked(request.choice))
                        if self._preparation.busy:
                            self._tell("preparing meshes ...")
                    link.send(request)
                    if request.reset or request.anew or request.release:
                        self._controls.free()

    def _take(self, told: Update) -> None:
        if told.failed:
            self.failure = told.failed
            self._controls.status(Update(), f"the simulation has ended: {told.failed}")
        if told.note:
            self._tell(told.note)
        if told.model is not None:
            self._waiting = False
            self._note = ""
            if self._drawing is None or self._drawing.model.key != told.model.key:
                if self._drawing is None:
                    furnish(self._server, told.model)
                else:
                    self._drawing.remove()
                self._drawing = Drawing(self._server.scene, told.model)
                self._shown = ()
            self.bounds = told.model.d_min, told.model.buffer
            self._controls.model(told.model, told.choice if told.refused else None)
            self._staged.set()
        if told.moment is not None and self._drawing is not None:
            self.told = told
            self._draw(told, self._drawing)

    def _tell(self, note: str) -> None:
        self._note, self._noted = note, clock.monotonic()
        self._controls.status(self.told, note)

    def _draw(self, told: Update, drawing: Drawing) -> None:
        assert told.moment is not None
        shown = (*self._controls.shown, self._controls.off)
        if shown != self._shown:
            views, kept, removed = self._controls.shown
            drawing.views_visible(views)
            drawing.clouds_visible(kept, removed)
            drawing.silence(self._controls.off)
            self._shown = shown
        drawing.show(told.moment)
        self.drawn += 1
        self._controls.told(told)
        self._controls.plots.add(told.moment)
        now = clock.monotonic()
        if now >= self._plotted + 1.0 / PLOT_HZ:
            self._plotted = now
            kept = self._preparation.busy or now < self._noted + _NOTED
            note = self._note if kept else ""
            self._controls.status(told, note)
            self._controls.plots.show(*self.bounds)

"""The live page: draws the updates of the simulation, sends it the requests of pages."""

import contextlib
import multiprocessing
import threading
import time as clock
from dataclasses import replace
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess

import viser

from proxcgal.core.errors import ProxError, SimulationError
from proxcgal.models.mesh.display import display_meshes
from proxcgal.scenario.scenario import Scenario
from proxcgal.scenario.setup import make_robot
from proxcgal.scenario.walkthrough_scenario import WalkScenario
from proxcgal.viewer.access import AccessControl
from proxcgal.viewer.choice import Choice
from proxcgal.viewer.command_queue import CommandQueue
from proxcgal.viewer.controller_panel import ControllerPanel
from proxcgal.viewer.drawing import Drawing, add_surroundings
from proxcgal.viewer.messages import Update
from proxcgal.viewer.simulation import FRAME_HZ, run_simulation
from proxcgal.viewer.walkthrough_panel import WalkPanel

PLOT_HZ = 4.0
REQUEST_HZ = 20.0  #: requests to the simulation, at most
_NOTE_S = 6.0  # [s] that a note stays


class LivePage:
    """One simulation and the pages that look at it."""

    def __init__(
        self,
        server: viser.ViserServer,
        access: AccessControl,
        scenario: Scenario,
        controller: str,
        hz: float = FRAME_HZ,
    ) -> None:
        """Starts the simulation in a process of its own.

        Args:
            server: behind its access control.
            access: of the server.
            scenario: what to run.
            controller: one of CONTROLLERS.
            hz: moments drawn a second.
        """
        self.queue = CommandQueue()
        self.last = Update()  #: the last moment that was drawn
        self.drawn = 0  #: moments so far
        self.bounds = (0.0, 0.0)  #: d_min and buffer of the controller [m]
        self._server = server
        self._panel: ControllerPanel | WalkPanel = (
            WalkPanel(server, access, self.queue, scenario)
            if isinstance(scenario, WalkScenario)
            else ControllerPanel(server, access, self.queue, scenario, controller)
        )
        self._drawing: Drawing | None = None
        self._shown: tuple[object, ...] = ()
        self._note, self._noted = "", 0.0
        self._plotted = 0.0
        self._waiting = True  # for the first model: no request before
        self._scene_ready = threading.Event()  # or the simulation has failed
        self._preparation = Preparation(scenario)
        self._closing = threading.Event()
        self.failure: str | None = None  #: why the simulation ended, where it did by itself
        context = multiprocessing.get_context("spawn")
        self._link, theirs = context.Pipe()
        self._process = context.Process(
            target=run_simulation, args=(theirs, scenario, controller, hz), daemon=True
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
        self._scene_ready.wait()
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
            self._receive_and_send(self._link)
        except (EOFError, OSError):
            self.failure = self.failure or "the simulation's process has ended"
        finally:
            self._scene_ready.set()

    def _receive_and_send(self, link: Connection) -> None:
        sent = 0.0
        while not self._closing.is_set() and self.failure is None:
            if link.poll(0.5 / REQUEST_HZ):
                update = link.recv()
                with self._server.atomic():
                    self._take(update)
                if update.moment is not None:
                    link.send(None)
            now = clock.monotonic()
            if not self._waiting and now >= sent + 1.0 / REQUEST_HZ:
                sent = now
                if (choice := self._preparation.done()) is not None:
                    self.queue.put(choice=choice)
                if (request := self.queue.take()) is not None:
                    if request.choice is not None:
                        request = replace(request, choice=self._preparation.asked(request.choice))
                        if self._preparation.busy:
                            self._show_note("preparing meshes ...")
                    link.send(request)
                    if request.reset or request.restart or request.release:
                        self._panel.drop_handle()

    def _take(self, update: Update) -> None:
        if update.failed:
            self.failure = update.failed
            self._panel.status(Update(), f"the simulation has ended: {update.failed}")
        if update.note:
            self._show_note(update.note)
        if update.model is not None:
            self._waiting = False
            self._note = ""
            if self._drawing is None or self._drawing.model.key != update.model.key:
                if self._drawing is None:
                    add_surroundings(self._server, update.model)
                else:
                    self._drawing.remove()
                self._drawing = Drawing(self._server.scene, update.model)
                self._shown = ()
            self.bounds = update.model.d_min, update.model.buffer
            self._panel.show_model(update.model, update.choice if update.refused else None)
            self._scene_ready.set()
        if update.moment is not None and self._drawing is not None:
            self.last = update
            self._draw(update, self._drawing)

    def _show_note(self, note: str) -> None:
        self._note, self._noted = note, clock.monotonic()
        self._panel.status(self.last, note)

    def _draw(self, update: Update, drawing: Drawing) -> None:
        assert update.moment is not None
        shown = (*self._panel.shown, self._panel.silent)
        if shown != self._shown:
            views, kept, removed = self._panel.shown
            drawing.views_visible(views)
            drawing.clouds_visible(kept, removed)
            drawing.silence(self._panel.silent)
            self._shown = shown
        drawing.show(update.moment)
        self.drawn += 1
        self._panel.move_handle(update)
        self._panel.plots.add(update.moment)
        now = clock.monotonic()
        if now >= self._plotted + 1.0 / PLOT_HZ:
            self._plotted = now
            kept = self._preparation.busy or now < self._noted + _NOTE_S
            self._panel.status(update, self._note if kept else "")
            self._panel.plots.show(*self.bounds)


class Preparation:
    """Fills the cache for one choice at a time, in a process of its own: no tick waits for it."""

    def __init__(self, scenario: Scenario) -> None:
        """Args: what the page shows; its own robot is there already."""
        self._scenario = scenario
        self._ready = {(scenario.robot, scenario.vertices_per_link)}
        self._process: BaseProcess | None = None
        self._choice: Choice | None = None

    @property
    def busy(self) -> bool:
        """Whether something is being made."""
        return self._process is not None

    def asked(self, choice: Choice) -> Choice | None:
        """The choice, where all is there; else it is begun, in place of what was being made."""
        self.close()
        if (choice.robot, choice.vertices) in self._ready:
            return choice
        self._choice = choice
        self._process = multiprocessing.get_context("spawn").Process(
            target=prepare, args=(self._scenario, choice), daemon=True
        )
        self._process.start()
        return None

    def done(self) -> Choice | None:
        """The choice whose meshes are ready now; errors are reported when it is set up."""
        if self._process is None or self._process.is_alive():
            return None
        choice, self._process, self._choice = self._choice, None, None
        if choice is not None:
            self._ready.add((choice.robot, choice.vertices))
        return choice

    def close(self) -> None:
        """Gives up what is being made."""
        if self._process is not None:
            self._process.terminate()
            self._process.join(timeout=2.0)
            self._process = self._choice = None


def prepare(scenario: Scenario, choice: Choice) -> None:
    """Makes the meshes, which stay in the cache; the target of a process."""
    with contextlib.suppress(ProxError, KeyboardInterrupt):
        display_meshes(make_robot(choice.applied(scenario)))

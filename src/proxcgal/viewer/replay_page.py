"""A recording in the browser: a time line to scrub, other settings' commands beside it."""

from __future__ import annotations

import threading
import time as clock
from typing import Any

import numpy as np
import viser

from proxcgal.core import modes
from proxcgal.sim.moment import Moment, metres
from proxcgal.viewer.access import Gate
from proxcgal.viewer.client_messages import between, one_of, switch
from proxcgal.viewer.drawing import Drawing, furnish
from proxcgal.viewer.plots import whole_run
from proxcgal.viewer.replayed import AHEAD, Replayed

HZ = 15.0  #: moments of a second of the recording
_SPEEDS = ("1/4", "1/2", "1", "2")


class ReplayPage:
    """Shows one moment at a time: the one at the time line's handle."""

    def __init__(
        self,
        server: viser.ViserServer,
        gate: Gate,
        recorded: Replayed,
        again: Replayed | None,
        words: str,
    ) -> None:
        """Draws the first moment.

        Args:
            server: behind its gate.
            gate: of the server.
            recorded: the run itself.
            again: its inputs under other settings; the same moments.
            words: what there is to say of both, in Markdown.
        """
        self._recorded, self._again = recorded, again
        self._times = np.array([moment.elapsed for moment in recorded.moments])
        self._server = server
        self._lock = threading.Lock()
        self._playing = False
        self._row = -1
        self._closing = threading.Event()
        furnish(server, recorded.model)
        self._drawings = [Drawing(server.scene, recorded.model)]
        if again is not None:
            self._drawings.append(Drawing(server.scene, again.model, name="/again", ghost=True))
        gui = server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
        gui.main_panel.dock_right()
        gui.add_markdown(words)
        end = float(self._times[-1])
        self._line: Any = gui.add_slider("time [s]", 0.0, max(end, 0.01), 0.01, 0.0)
        gate.offer(self._line, between(0.0, end))
        buttons = gui.add_button_group("replay", ("play", "pause", "back", "next"))
        gate.offer(buttons, one_of(("play", "pause", "back", "next")))
        self._speed = gui.add_dropdown("speed", _SPEEDS, initial_value="1")
        gate.offer(self._speed, one_of(_SPEEDS))
        self._views = gui.add_checkbox("fields of view", True)
        gate.offer(self._views, switch)
        self._status = gui.add_markdown("")
        whole_run(gui, recorded.moments, again.moments if again else None, recorded.model)

        async def scrubbed(_: Any) -> None:
            # The nearest: the line counts in hundredths of a second, and moments may lie between.
            self.show(int(np.abs(self._times - self._line.value).argmin()))

        async def pressed(event: Any) -> None:
            self._press(event.target.value)

        async def views(_: Any) -> None:
            self._drawings[0].views_visible(self._views.value)

        self._line.on_update(scrubbed)
        buttons.on_click(pressed)
        self._views.on_update(views)
        self.show(0)
        self._thread = threading.Thread(target=self._play, daemon=True)
        self._thread.start()

    @property
    def row(self) -> int:
        """Of the moment that is shown."""
        return self._row

    def show(self, row: int) -> None:
        """Shows the moment of that row."""
        row = min(max(row, 0), len(self._times) - 1)
        with self._lock, self._server.atomic():
            if row == self._row:
                return
            self._row = row
            moment = self._recorded.moments[row]
            self._drawings[0].show(moment)
            other = None if self._again is None else self._again.moments[row]
            if other is not None:
                self._drawings[1].show(other)
            self._status.content = _status(moment, other)

    def close(self) -> None:
        """Ends the playing."""
        self._closing.set()
        self._thread.join(timeout=2.0)

    def _press(self, button: str) -> None:
        last = len(self._times) - 1
        if button == "play":
            self._playing = True
            if self._row >= last:
                self._go(0)
        else:
            self._playing = False
            if button != "pause":
                self._go(self._row + (1 if button == "next" else -1))

    def _go(self, row: int) -> None:
        row = min(max(row, 0), len(self._times) - 1)
        self._line.value = round(float(self._times[row]), 2)
        self.show(row)

    def _play(self) -> None:
        at = clock.monotonic()
        while not self._closing.wait(1.0 / HZ):
            now = clock.monotonic()
            if self._playing:
                numerator, _, denominator = self._speed.value.partition("/")
                speed = int(numerator) / int(denominator or 1)
                time = self._times[self._row] + max(speed * (now - at), 1e-6)
                row = int(np.searchsorted(self._times, time))
                if row > self._row:
                    at = now
                    self._go(row)
                if row >= len(self._times) - 1:
                    self._playing = False
            else:
                at = now


def _status(moment: Moment, other: Moment | None) -> str:
    lines = [f"**{modes.NAMES[moment.mode]}** at {moment.elapsed:.2f} s", _words(moment)]
    if moment.found:
        lines.append("found: " + ", ".join(moment.found))
    if other is not None:
        apart = float(np.abs(moment.qd - other.qd).max())
        lines += [
            f"**recomputed: {modes.NAMES[other.mode]}**", _words(other),
            f"commands apart by up to {apart:.4f} rad/s; the see-through arm is where the "
            f"recomputed one leads in {AHEAD:g} s",
        ]  # fmt: skip
    return "  \n".join(lines)


def _words(moment: Moment) -> str:
    seen, true = map(metres, (moment.seen, moment.true))
    return (
        f"seen {seen}, true {true}, activation {moment.activation:.2f}, "
        f"moves {moment.link or 'nothing'}"
    )


def said(recorded: Replayed, again: Replayed | None) -> str:
    """Is it shown as recorded or computed again, and what was computed beside it?"""
    if recorded.same is None:
        text = f"{recorded.ticks} ticks, shown as recorded"
        text += "" if recorded.clouds else ", without clouds"
    elif recorded.same == recorded.ticks:
        text = (
            f"recomputed with its own settings: all {recorded.ticks} answers are those recorded, "
            "bit for bit"
        )
    else:
        text = (
            f"recomputed with its own settings: {recorded.ticks - recorded.same} of "
            f"{recorded.ticks} answers differ from the recorded ones (another build or meshes)"
        )
    if again is not None and again.same is not None:
        text += (
            f"; as {again.controller} with what was asked for: {again.ticks - again.same} of "
            f"{again.ticks} answers differ, the arm moves as recorded"
        )
    return text

"""A recording in the browser: a time line to scrub, other settings' commands beside it."""

import sys
import threading
import time as clock
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import viser

from proxcgal.core import modes
from proxcgal.recording.reader import Recording
from proxcgal.sim.moment import Moment, metres
from proxcgal.viewer.access import AccessControl
from proxcgal.viewer.drawing import Drawing, add_surroundings
from proxcgal.viewer.page_server import checked_token, page_address, served_page
from proxcgal.viewer.panel import AllowedControls
from proxcgal.viewer.plots import plot_whole_run
from proxcgal.viewer.replay_moments import AHEAD, ReplayedRun, replay_moments

HZ = 15.0  #: moments of a second of the recording
_SPEEDS = ("1/4", "1/2", "1", "2")


class ReplayPage:
    """Shows one moment at a time: the one at the time line's handle."""

    def __init__(
        self,
        server: viser.ViserServer,
        access: AccessControl,
        recorded: ReplayedRun,
        again: ReplayedRun | None,
        text: str,
    ) -> None:
        """Draws the first moment.

        Args:
            server: behind its access control.
            access: of the server.
            recorded: the run itself.
            again: its inputs under other settings; the same moments.
            text: about both, in Markdown.
        """
        self._recorded, self._again = recorded, again
        self._times = np.array([moment.elapsed for moment in recorded.moments])
        self._server = server
        self._lock = threading.Lock()
        self._playing = False
        self.row = -1  #: of the moment that is shown
        self._closing = threading.Event()
        add_surroundings(server, recorded.model)
        self._drawings = [Drawing(server.scene, recorded.model)]
        if again is not None:
            self._drawings.append(Drawing(server.scene, again.model, name="/again", ghost=True))
        gui, controls = server.gui, AllowedControls(server, access)
        gui.add_markdown(text)
        end = max(float(self._times[-1]), 0.01)
        self._line = controls.add_slider("time [s]", (0.0, end, 0.01), 0.0)
        controls.add_buttons(
            "replay",
            {name: partial(self._press, name) for name in ("play", "pause", "back", "next")},
        )
        self._speed = controls.add_list("speed", _SPEEDS, "1")
        controls.add_switch("fields of view", True, self._drawings[0].views_visible)
        self._status = gui.add_markdown("")
        plot_whole_run(gui, recorded.moments, again.moments if again else None, recorded.model)

        async def scrubbed(_: Any) -> None:
            # The nearest: the line counts in hundredths of a second, and moments may lie between.
            self.show(int(np.abs(self._times - self._line.value).argmin()))

        self._line.on_update(scrubbed)
        self.show(0)
        self._thread = threading.Thread(target=self._play, daemon=True)
        self._thread.start()

    def show(self, row: int) -> None:
        """Shows the moment of that row."""
        row = min(max(row, 0), len(self._times) - 1)
        with self._lock, self._server.atomic():
            if row == self.row:
                return
            self.row = row
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
            if self.row >= last:
                self._go(0)
        else:
            self._playing = False
            if button != "pause":
                self._go(self.row + (1 if button == "next" else -1))

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
                time = self._times[self.row] + max(speed * (now - at), 1e-6)
                row = int(np.searchsorted(self._times, time))
                if row > self.row:
                    at = now
                    self._go(row)
                if row >= len(self._times) - 1:
                    self._playing = False
            else:
                at = now


def _status(moment: Moment, other: Moment | None) -> str:
    lines = [f"**{modes.NAMES[moment.mode]}** at {moment.elapsed:.2f} s", _numbers_text(moment)]
    if moment.found:
        lines.append("found: " + ", ".join(moment.found))
    if other is not None:
        apart = float(np.abs(moment.qd - other.qd).max())
        lines += [
            f"**recomputed: {modes.NAMES[other.mode]}**", _numbers_text(other),
            f"commands apart by up to {apart:.4f} rad/s; the see-through arm is where the "
            f"recomputed one leads in {AHEAD:g} s",
        ]  # fmt: skip
    return "  \n".join(lines)


def _numbers_text(moment: Moment) -> str:
    seen, true = map(metres, (moment.seen, moment.true))
    return (
        f"seen {seen}, true {true}, activation {moment.activation:.2f}, "
        f"moves {moment.link or 'nothing'}"
    )


def view_recording(
    recording: Recording,
    controller: str | None,
    changes: Sequence[str],
    *,
    host: str,
    port: int,
    token: str | None,
) -> None:
    """Serves the page of a recording until interrupted; prints its address.

    Args:
        recording: of a run, not empty.
        controller: beside the recorded one; None: none, unless anything is changed.
        changes: `key.sub=value` on the recorded scenario, for the run beside it.
        host: address to listen on.
        port: 0 for any that is free.
        token: that every viewer must show, as typed.

    Raises:
        ConfigError: an address that cannot be listened on, a bad token or change.
    """
    token = checked_token(host, port, token)
    recorded = replay_moments(recording, HZ)
    again = None
    if controller is not None or changes:
        again = replay_moments(recording, HZ, controller, changes, ahead=True)
    text = comparison_text(recorded, again)
    label = f"proxcgal: {recording.path.name}"
    with served_page(host, port, label=label, token=token) as (server, access):
        page = ReplayPage(server, access, recorded, again, text)
        try:
            print(text)
            print(page_address(host, server.get_port(), token), flush=True)
            if sys.stdout.isatty():
                print("Ctrl-C: end; with --no-view: lines here instead of the page", flush=True)
            threading.Event().wait()
        finally:
            page.close()


def comparison_text(recorded: ReplayedRun, again: ReplayedRun | None) -> str:
    """Whether it is shown as recorded or computed again, and what was computed beside it."""
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

"""The panel of a walk-through: the guard's state and button, what it watches, the hand."""

import numpy as np
import viser

from proxcgal.scenario.walkthrough_keys import GuardKeys
from proxcgal.scenario.walkthrough_scenario import WalkScenario
from proxcgal.sim.moment import Posed
from proxcgal.trial.walkthrough.interactive import WalkMoment
from proxcgal.viewer.access import AccessControl
from proxcgal.viewer.command_queue import CommandQueue
from proxcgal.viewer.messages import Update
from proxcgal.viewer.panel import Panel, pace, timing
from proxcgal.viewer.plots import RecentRows, plot
from proxcgal.viewer.scene_model import SceneModel

ENABLE = "enable torque"
_BLUE, _RED, _GREEN, _ORANGE = "#2a5fb0", "#d61e28", "#10963c", "#dc7814"
_HIGHEST_M, _HIGHEST_MPS, _HIGHEST_SHARE = 1.6, 2.0, 1.5
_HEIGHT = 150  # [px]
_DASHED, _DOTTED = (5, 4), (2, 3)


class WalkPanel(Panel):
    """Drag the hand; look at what the guard watches; switch the torque on again."""

    def __init__(
        self,
        server: viser.ViserServer,
        access: AccessControl,
        queue: CommandQueue,
        scenario: WalkScenario,
    ) -> None:
        """Adds everything."""
        super().__init__(server, access, queue)
        self.add_button(ENABLE, lambda: queue.put(enable=True))
        self.plots = WalkPlots(server.gui, scenario.guard)

    def show_model(self, model: SceneModel, back: object) -> None:
        """Controls of the model, which stays the same."""
        if self._model is None:
            self._model = model
            self._dragging(model, "hand")

    def move_handle(self, update: Update) -> None:
        """Puts the handle at the tool, unless a hand holds that."""
        if isinstance(update.moment, WalkMoment) and update.moment.state != "on":
            self._held = False  # a hand lets go of an arm that has stopped
        super().move_handle(update)

    def _lines(self, update: Update) -> list[str]:
        moment = update.moment
        assert isinstance(moment, WalkMoment)
        lines = [f"{_state(moment)} at {moment.elapsed:.1f} s{pace(update)}"]
        if moment.trip:
            count = "" if moment.trips == 1 else f", {moment.trips} trips so far"
            when = "last trip" if moment.state == "on" else "tripped"
            lines.append(f"{when}: **{moment.trip}**{count}")
            if moment.state == "off":
                lines.append(f"at rest {moment.stop_time:.3f} s after the trip")
        if moment.overrun:
            lines.append("**the stop took longer than declared: the torque can't be had any more**")
        if moment.refused:
            lines.append(f"**not switched on: {moment.refused}**")
        elif moment.state != "on" and moment.violated:
            lines.append(f"violated now: {', '.join(moment.violated)}")
        hand = f"pulls with {moment.force:.0f} N" if moment.gripped else "holds nothing"
        return [*lines, f"the hand {hand}", timing(update, "cycle")]


class WalkPlots:
    """What the guard watches, over the last 10 s, with its bounds."""

    def __init__(self, gui: viser.GuiApi, keys: GuardKeys) -> None:
        """Adds three plots."""
        self._rows = RecentRows()
        self._keys = keys
        self._distance = plot(
            gui, "distance to operator [m], time [s]", _HIGHEST_M, _HEIGHT,
            ("least of the pairs", _BLUE, ()), ("ISO/TS 15066", _GREEN, _DASHED),
            ("bound", _RED, _DOTTED),
        )  # fmt: skip
        self._speed = plot(
            gui, "speed [m/s], time [s]", _HIGHEST_MPS, _HEIGHT,
            ("tool", _BLUE, ()), ("its bound", _RED, _DOTTED),
            ("approach", _GREEN, ()), ("its bound", _ORANGE, _DASHED),
        )  # fmt: skip
        self._joints = plot(
            gui, "joints, share of the bound, time [s]", _HIGHEST_SHARE, _HEIGHT - 20,
            ("speed", _BLUE, ()), ("acceleration", _GREEN, ()), ("bound", _RED, _DOTTED),
        )  # fmt: skip

    def add(self, moment: Posed) -> None:
        """One moment more; an earlier time than the last one clears the curves."""
        assert isinstance(moment, WalkMoment)
        worst = moment.worst
        if moment.elapsed != self._rows.last:
            self._rows.add(
                moment.elapsed, worst.distance, worst.protective, worst.tcp_speed, worst.velocity,
                worst.speed_ratio, worst.acceleration_ratio,
            )  # fmt: skip

    def show(self, *_: float) -> None:
        """Draws what was added."""
        if not self._rows.drawable:
            return
        time, distance, iso, tool, towards, speed, acceleration = self._rows.columns()
        keys, flat = self._keys, np.ones_like(time)
        self._distance.data = (
            time, np.minimum(distance, _HIGHEST_M), np.minimum(iso, _HIGHEST_M),
            keys.min_distance * flat,
        )  # fmt: skip
        self._speed.data = (
            time, np.minimum(tool, _HIGHEST_MPS), keys.tcp_speed * flat,
            np.clip(towards, 0.0, _HIGHEST_MPS), keys.max_velocity * flat,
        )  # fmt: skip
        self._joints.data = (
            time,
            np.minimum(speed, _HIGHEST_SHARE),
            np.minimum(acceleration, _HIGHEST_SHARE),
            flat,
        )


def _state(moment: WalkMoment) -> str:
    if moment.state == "on":
        return "**TORQUE ON**"
    if moment.state == "stopping":
        return "**TORQUE OFF, stopping**"
    why = "tripped" if moment.trips else f"press '{ENABLE}'"
    return f"**TORQUE OFF, brakes hold: {why}**"

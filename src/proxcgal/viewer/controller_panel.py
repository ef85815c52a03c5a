"""The panel of an arm that keeps its distance: controller, sensors, what stands round it."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import viser

from proxcgal.core import modes
from proxcgal.scenario.scenario import CONTROLLERS, Scenario
from proxcgal.sim.moment import Moment, metres
from proxcgal.viewer.access import AccessControl
from proxcgal.viewer.choice import (
    BUFFER,
    D_MIN,
    GAIN,
    Choice,
    resolutions,
    robots,
)
from proxcgal.viewer.command_queue import CommandQueue
from proxcgal.viewer.messages import Update
from proxcgal.viewer.panel import Panel, pace, timing
from proxcgal.viewer.plots import Plots
from proxcgal.viewer.scene_model import SceneModel

_AS_THEY_ARE = "as they are"


class ControllerPanel(Panel):
    """Switches, sliders, sensors, and what can be dragged."""

    def __init__(
        self,
        server: viser.ViserServer,
        access: AccessControl,
        queue: CommandQueue,
        scenario: Scenario,
        controller: str,
    ) -> None:
        """Adds everything, as the scenario has it."""
        super().__init__(server, access, queue)
        self._choice = Choice.of(scenario, controller)
        self._scenario = scenario
        self._sensors: list[Any] = []
        gui = server.gui
        self.plots = Plots(gui)
        with gui.add_folder("controller"):
            self._lists = {
                "controller": self.add_list("law", CONTROLLERS, controller),
                "robot": self.add_list("robot", robots(scenario), scenario.robot),
                "vertices": self.add_list(
                    "mesh", [_count(n) for n in resolutions(scenario)],
                    _count(scenario.vertices_per_link),
                ),
            }  # fmt: skip
            self._noise = self.add_switch("noise", True, lambda on: self._choose(noise=on))
            self._sliders = {
                "d_min": self.add_slider("d_min [m]", D_MIN, self._choice.d_min),
                "buffer": self.add_slider("buffer [m]", BUFFER, self._choice.buffer),
                "gain": self.add_slider("gain [1/s]", GAIN, self._choice.gain),
            }
        self._hook_choices()
        with gui.add_folder("show"):
            self._views = self.add_switch("fields of view", True, None)
            self._kept = self.add_switch("filtered cloud", True, None)
            self._removed = self.add_switch("removed points", True, None)

    @property
    def shown(self) -> tuple[bool, bool, bool]:
        """Visibility of fields of view, filtered cloud, removed points."""
        return self._views.value, self._kept.value, self._removed.value

    def show_model(self, model: SceneModel, back: Choice | None) -> None:
        """Controls of another model; `back` is shown where the requested choice does not fit."""
        if back is not None:
            self._choice = back  # first: the events of the controls then change nothing
            self._noise.value = back.noise
            for name, control in (*self._lists.items(), *self._sliders.items()):
                value = getattr(back, name)
                control.value = _count(value) if name == "vertices" else value
        if self._model is None or self._model.key != model.key:
            self._renew(model)
        self._model = model

    def _renew(self, model: SceneModel) -> None:
        """Controls of this model: the handle and the sensors."""
        for old in [*self._of_model, *self._sensors]:
            old.remove()
        self._of_model, self._sensors = [], []
        gui = self._server.gui
        if model.draggable:
            self._dragging(model, "obstacle")
        folder = gui.add_folder("sensors", expand_by_default=False)
        with folder:
            switches = [self.add_switch(name, True, None) for name in model.sensors]

        async def silenced(_: Any) -> None:
            self.silent = frozenset(row for row, each in enumerate(switches) if not each.value)
            self._queue.put(silent=self.silent)

        for each in switches:
            each.on_update(silenced)
        self.silent = frozenset()
        self._sensors = [folder]

    def _lines(self, update: Update) -> list[str]:
        moment = update.moment
        assert isinstance(moment, Moment)
        seen, true = map(metres, (moment.seen, moment.true))
        held = f", {len(moment.held_W)} of silent sensors" if len(moment.held_W) else ""
        return [
            f"**{modes.NAMES[moment.mode]}** at {moment.elapsed:.1f} s" + pace(update),
            f"seen {seen}, true {true}, activation {moment.activation:.2f}",
            f"moves {moment.link or 'nothing'}",
            f"{len(moment.kept_W)} points kept, {len(moment.removed_W)} removed{held}",
            timing(update, "tick"),
            *(["found: " + ", ".join(moment.found)] if moment.found else []),
        ]

    def _choose(self, **changes: Any) -> None:
        changed = replace(self._choice, **changes)
        if changed != self._choice:
            self._choice = changed
            self._queue.put(choice=changed)

    def _hook_choices(self) -> None:
        read: dict[str, Callable[[Any], Any]] = {
            "vertices": lambda text: 0 if text == _AS_THEY_ARE else int(text.split()[0]),
            "controller": str,
            "robot": str,
        }
        for name, control in (*self._lists.items(), *self._sliders.items()):

            async def changed(event: Any, name: str = name) -> None:
                self._choose(**{name: read.get(name, float)(event.target.value)})

            control.on_update(changed)


def _count(vertices: int) -> str:
    return f"{vertices} vertices a link" if vertices else _AS_THEY_ARE

"""The panel of an arm that keeps its distance: law, sensors, what stands round it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import viser

from proxcgal.core import modes
from proxcgal.scenario.scenario import CONTROLLERS, Scenario
from proxcgal.sim.moment import Moment, metres
from proxcgal.viewer.access import Gate
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


class Controls(Panel):
    """Switches, sliders, sensors, and what can be dragged."""

    def __init__(
        self,
        server: viser.ViserServer,
        gate: Gate,
        queue: CommandQueue,
        scenario: Scenario,
        controller: str,
    ) -> None:
        """Adds everything, as the scenario has it."""
        super().__init__(server, gate, queue)
        self._choice = Choice.of(scenario, controller)
        self._scenario = scenario
        self._sensors: list[Any] = []
        gui = server.gui
        self.plots = Plots(gui)
        with gui.add_folder("controller"):
            self._lists = {
                "controller": self._list("law", CONTROLLERS, controller),
                "robot": self._list("robot", robots(scenario), scenario.robot),
                "vertices": self._list(
                    "mesh", [_count(n) for n in resolutions(scenario)],
                    _count(scenario.vertices_per_link),
                ),
            }  # fmt: skip
            self._noise = self._switch("noise", True, lambda on: self._choose(noise=on))
            self._sliders = {
                "d_min": self._slider("d_min [m]", D_MIN, self._choice.d_min),
                "buffer": self._slider("buffer [m]", BUFFER, self._choice.buffer),
                "gain": self._slider("gain [1/s]", GAIN, self._choice.gain),
            }
        self._hook_choices()
        with gui.add_folder("show"):
            self._views = self._switch("fields of view", True, None)
            self._kept = self._switch("filtered cloud", True, None)
            self._removed = self._switch("removed points", True, None)

    @property
    def shown(self) -> tuple[bool, bool, bool]:
        """Fields of view, filtered cloud, removed points: are they to be seen?"""
        return self._views.value, self._kept.value, self._removed.value

    def model(self, model: SceneModel, back: Choice | None) -> None:
        """Another stage; `back` is shown where what was wanted could not be."""
        if back is not None:
            self._choice = back  # first: what the controls tell then is nothing new
            self._lists["controller"].value = back.controller
            self._lists["robot"].value = back.robot
            self._lists["vertices"].value = _count(back.vertices)
            self._noise.value = back.noise
            for name, slider in self._sliders.items():
                slider.value = getattr(back, name)
        if self._model is None or self._model.key != model.key:
            self._renew(model)
        self._model = model

    def status(self, told: Update, note: str) -> None:
        """The lines above the buttons."""
        if isinstance(told.moment, Moment):
            self._status.content = _status(told, told.moment, note)
        elif note:
            self._status.content = note

    def _renew(self, model: SceneModel) -> None:
        """Controls of what is on the stage: the handle and the sensors."""
        for old in [*self._of_stage, *self._sensors]:
            old.remove()
        self._of_stage, self._sensors = [], []
        gui = self._server.gui
        if model.grips:
            self._dragging(model, "obstacle")
        folder = gui.add_folder("sensors", expand_by_default=False)
        with folder:
            switches = [self._switch(name, True, None) for name in model.sensors]

        async def silenced(_: Any) -> None:
            off = frozenset(row for row, each in enumerate(switches) if not each.value)
            self._queue.want(off=off)
            self.off = off

        for each in switches:
            each.on_update(silenced)
        self.off = frozenset()
        self._sensors = [folder]

    def _choose(self, **changes: Any) -> None:
        changed = replace(self._choice, **changes)
        if changed != self._choice:
            self._choice = changed
            self._queue.want(choice=changed)

    def _hook_choices(self) -> None:
        read: dict[str, Callable[[Any], Any]] = {
            "vertices": _number_of, "controller": str, "robot": str,
        }  # fmt: skip
        for name, control in (*self._lists.items(), *self._sliders.items()):

            async def changed(event: Any, name: str = name) -> None:
                self._choose(**{name: read.get(name, float)(event.target.value)})

            control.on_update(changed)


def _count(vertices: int) -> str:
    return f"{vertices} vertices a link" if vertices else _AS_THEY_ARE


def _number_of(text: str) -> int:
    return 0 if text == _AS_THEY_ARE else int(text.split()[0])


def _status(told: Update, moment: Moment, note: str) -> str:
    seen, true = map(metres, (moment.seen, moment.true))
    lines = [
        f"**{modes.NAMES[moment.mode]}** at {moment.elapsed:.1f} s" + pace(told),
        f"seen {seen}, true {true}, activation {moment.activation:.2f}",
        f"moves {moment.link or 'nothing'}",
        f"{len(moment.kept_W)} points kept, {len(moment.removed_W)} removed"
        + (f", {len(moment.held_W)} of silent sensors" if len(moment.held_W) else ""),
        timing(told, "tick"),
    ]
    if moment.found:
        lines.append("found: " + ", ".join(moment.found))
    if note:
        lines.append(f"**{note}**")
    return "  \n".join(lines)

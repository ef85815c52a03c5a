"""The panel of the live page: switches, sliders, buttons, plots, and the handle to drag with."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import viser
import viser.transforms
from numpy.typing import NDArray

from proxcgal.apps.view.choice import (
    BUFFER,
    D_MIN,
    GAIN,
    Choice,
    resolutions,
    robots,
)
from proxcgal.apps.view.desk import ROOM, Desk
from proxcgal.apps.view.drawing import Drawing, pose_parts
from proxcgal.apps.view.gate import Gate
from proxcgal.apps.view.messages import between, one_of, switch
from proxcgal.apps.view.plots import Plots
from proxcgal.apps.view.simulation import Told
from proxcgal.apps.view.stage import Stage
from proxcgal.sim.moment import MODES, Moment
from proxcgal.sim.scenario import CONTROLLERS, Scenario

Array = NDArray[np.float64]

HANDLE = "/handle"
_AS_THEY_ARE = "as they are"


class Controls:
    """Puts on the desk what pages want; shows what the simulation tells."""

    def __init__(
        self,
        server: viser.ViserServer,
        gate: Gate,
        desk: Desk,
        scenario: Scenario,
        controller: str,
    ) -> None:
        """Adds everything, as the scenario has it."""
        self._server, self._gate, self._desk = server, gate, desk
        self._choice = Choice.of(scenario, controller)
        self._scenario = scenario
        self._stage: Stage | None = None
        self._sensors: list[Any] = []
        self._of_stage: list[Any] = []
        self._held = False
        gui = server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
        gui.main_panel.dock_right()
        self._status = gui.add_markdown("setting up ...")
        self._buttons(
            "simulation",
            {
                "run": lambda: desk.want(running=True),
                "pause": lambda: desk.want(running=False),
                "step": lambda: desk.want(running=False, steps=1),
                "reset": lambda: desk.want(reset=True),
            },
        )
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

    def stage(self, stage: Stage, back: Choice | None) -> None:
        """Another stage; `back` is shown where what was wanted could not be."""
        if back is not None:
            self._choice = back  # first: what the controls tell then is nothing new
            self._lists["controller"].value = back.controller
            self._lists["robot"].value = back.robot
            self._lists["vertices"].value = _count(back.vertices)
            self._noise.value = back.noise
            for name, slider in self._sliders.items():
                slider.value = getattr(back, name)
        if self._stage is None or self._stage.key != stage.key:
            self._renew(stage)
        self._stage = stage

    def told(self, told: Told, drawing: Drawing) -> None:
        """What the status line and the handle say."""
        moment = told.moment
        assert moment is not None
        if self._of_stage and not self._held and drawing.stage.names:
            handle = self._of_stage[0]
            wxyz, position = pose_parts(moment.solids_W[self._row()])
            if not np.allclose(handle.position, position, atol=1e-4):
                handle.position = position
            if not np.allclose(handle.wxyz, wxyz, atol=1e-4):
                handle.wxyz = wxyz

    def status(self, told: Told, note: str) -> None:
        """The lines above the buttons."""
        if told.moment is not None:
            self._status.content = _status(told, told.moment, note)
        elif note:
            self._status.content = note

    def free(self) -> None:
        """Nobody holds anything any more."""
        self._held = False

    def _renew(self, stage: Stage) -> None:
        """Controls of what is on the stage: the handle and the sensors."""
        for old in [*self._of_stage, *self._sensors]:
            old.remove()
        self._of_stage, self._sensors = [], []
        gui = self._server.gui
        if stage.names:
            self._of_stage.append(self._handle(stage))
            folder = gui.add_folder("obstacle")
            with folder:
                names = list(dict.fromkeys(stage.names))
                self._which = self._list("drag", names, _first(stage, names))
                self._which.on_update(self._other)
                self._button("let go", self._let_go)
            self._of_stage.append(folder)
        folder = gui.add_folder("sensors", expand_by_default=False)
        with folder:
            switches = [self._switch(name, True, None) for name in stage.sensors]

        async def silenced(_: Any) -> None:
            off = frozenset(row for row, each in enumerate(switches) if not each.value)
            self._desk.want(off=off)
            self.off = off

        for each in switches:
            each.on_update(silenced)
        self.off = frozenset()
        self._sensors = [folder]

    off: frozenset[int] = frozenset()

    def _handle(self, stage: Stage) -> Any:
        (x0, y0, z0), (x1, y1, z1) = ROOM.tolist()
        row = stage.names.index(_first(stage, list(stage.names)))
        wxyz, position = pose_parts(stage.solids_W[row])
        handle = self._server.scene.add_transform_controls(
            HANDLE, scale=0.3, depth_test=False, wxyz=wxyz, position=position,
            translation_limits=((x0, x1), (y0, y1), (z0, z1)),
        )  # fmt: skip

        async def dragged(_: Any) -> None:
            self._held = True
            T_WO = np.eye(4)
            T_WO[:3, :3] = viser.transforms.SO3(np.asarray(handle.wxyz)).as_matrix()
            T_WO[:3, 3] = handle.position
            self._desk.move(self._which.value, T_WO)

        handle.on_update(dragged)
        return handle

    def _row(self) -> int:
        assert self._stage is not None
        return self._stage.names.index(self._which.value)

    async def _other(self, _: Any) -> None:
        self._held = False  # the handle goes to the solid that is chosen

    def _let_go(self) -> None:
        self._held = False
        self._desk.want(release=True)

    def _choose(self, **changes: Any) -> None:
        changed = replace(self._choice, **changes)
        if changed != self._choice:
            self._choice = changed
            self._desk.want(choice=changed)

    def _hook_choices(self) -> None:
        read: dict[str, Callable[[Any], Any]] = {
            "vertices": _number_of, "controller": str, "robot": str,
        }  # fmt: skip
        for name, control in (*self._lists.items(), *self._sliders.items()):

            async def changed(event: Any, name: str = name) -> None:
                self._choose(**{name: read.get(name, float)(event.target.value)})

            control.on_update(changed)

    def _button(self, label: str, work: Callable[[], None]) -> Any:
        button = self._server.gui.add_button(label)
        self._gate.offer(button, switch)

        async def clicked(_: Any) -> None:
            work()

        button.on_click(clicked)
        return button

    def _buttons(self, label: str, work: Mapping[str, Callable[[], None]]) -> None:
        group = self._server.gui.add_button_group(label, tuple(work))
        self._gate.offer(group, one_of(work))

        async def clicked(event: Any) -> None:
            work[event.target.value]()

        group.on_click(clicked)

    def _list(self, label: str, options: Sequence[str], value: str) -> Any:
        control = self._server.gui.add_dropdown(label, tuple(options), initial_value=value)
        self._gate.offer(control, one_of(options))
        return control

    def _switch(self, label: str, value: bool, work: Callable[[bool], None] | None) -> Any:
        control = self._server.gui.add_checkbox(label, value)
        self._gate.offer(control, switch)
        if work is not None:

            async def changed(event: Any) -> None:
                work(bool(event.target.value))

            control.on_update(changed)
        return control

    def _slider(self, label: str, bounds: tuple[float, float, float], value: float) -> Any:
        low, high, step = min(bounds[0], value), max(bounds[1], value), bounds[2]
        control = self._server.gui.add_slider(label, low, high, step, value)
        self._gate.offer(control, between(low, high))
        return control


def _first(stage: Stage, names: Sequence[str]) -> str:
    """What the handle begins at: a hand where there is one, else what is nearest to the tool."""
    hands = [name for name in names if "hand" in name] or names
    far = np.linalg.norm(stage.solids_W[:, :3, 3] - stage.tool_W, axis=1)
    return min(hands, key=lambda name: float(far[stage.names.index(name)]))


def _count(vertices: int) -> str:
    return f"{vertices} vertices a link" if vertices else _AS_THEY_ARE


def _number_of(text: str) -> int:
    return 0 if text == _AS_THEY_ARE else int(text.split()[0])


def _status(told: Told, moment: Moment, note: str) -> str:
    seen, true = (f"{d:.3f} m" if d < 9.0 else "nothing" for d in (moment.seen, moment.true))
    lines = [
        f"**{MODES[moment.mode]}** at {moment.elapsed:.1f} s"
        + ("" if told.running else ", paused")
        + (f", {100.0 * told.real_time:.0f} % of real time" if told.real_time < 0.97 else ""),
        f"seen {seen}, true {true}, activation {moment.activation:.2f}",
        f"moves {moment.link or 'nothing'}",
        f"{len(moment.kept_W)} points kept, {len(moment.removed_W)} removed"
        + (f", {len(moment.held_W)} of silent sensors" if len(moment.held_W) else ""),
        f"tick {told.cpu_us:.0f} us of CPU, late by {told.late_us[0] / 1e3:.1f} ms (p99 "
        f"{told.late_us[1] / 1e3:.0f})",
    ]
    if moment.found:
        lines.append("found: " + ", ".join(moment.found))
    if note:
        lines.append(f"**{note}**")
    return "  \n".join(lines)

"""What every panel of the live page has: buttons, lists, and the handle to drag with."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import viser
import viser.transforms

from proxcgal.sim.moment import Posed
from proxcgal.trial.walkthrough.operator_hand import HAND
from proxcgal.viewer.access import Gate
from proxcgal.viewer.client_messages import between, one_of, switch
from proxcgal.viewer.command_queue import ROOM, CommandQueue
from proxcgal.viewer.drawing import pose_parts, viewpoint
from proxcgal.viewer.messages import Update
from proxcgal.viewer.scene_model import SceneModel

HANDLE = "/handle"
_HANDLE_SHARE = 0.1  # of the distance that a page begins to look from: large enough to be caught


class Panel:
    """Puts on the desk what pages want; every control is offered at the gate."""

    off: frozenset[int] = frozenset()  #: rows of the sensors that are silent

    def __init__(self, server: viser.ViserServer, gate: Gate, queue: CommandQueue) -> None:
        """Adds the status line and the buttons of the simulation."""
        self._server, self._gate, self._queue = server, gate, queue
        self._model: SceneModel | None = None
        self._of_stage: list[Any] = []
        self._held = False
        gui = server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
        gui.main_panel.dock_right()
        self._status = gui.add_markdown("setting up ...")
        self._buttons(
            "simulation",
            {
                "run": lambda: queue.want(running=True),
                "pause": lambda: queue.want(running=False),
                "step": lambda: queue.want(running=False, steps=1),
                "reset": lambda: queue.want(reset=True),
            },
        )

    @property
    def shown(self) -> tuple[bool, bool, bool]:
        """Fields of view, filtered cloud, removed points: are they to be seen?"""
        return True, True, True

    def told(self, told: Update) -> None:
        """Where the handle is while nobody holds it."""
        moment = told.moment
        assert moment is not None
        if self._of_stage and not self._held:
            handle = self._of_stage[0]
            wxyz, position = pose_parts(self._place(moment))
            if not np.allclose(handle.position, position, atol=1e-4):
                handle.position = position
            if not np.allclose(handle.wxyz, wxyz, atol=1e-4):
                handle.wxyz = wxyz

    def free(self) -> None:
        """Nobody holds anything any more."""
        self._held = False

    def _dragging(self, model: SceneModel, title: str) -> None:
        """The handle, and the list of what it moves."""
        self._of_stage.append(self._handle(model))
        folder = self._server.gui.add_folder(title)
        with folder:
            names = list(dict.fromkeys(model.grips))
            self._which = self._list("drag", names, first_grip(model))
            self._which.on_update(self._other)
            self._button("let go", self._let_go)
        self._of_stage.append(folder)

    def _handle(self, model: SceneModel) -> Any:
        (x0, y0, z0), (x1, y1, z1) = ROOM.tolist()
        name, T_W = first_grip(model), np.eye(4)
        T_W[:3, 3] = model.tool_W
        if name in model.names:
            T_W = model.solids_W[model.names.index(name)]
        wxyz, position = pose_parts(T_W)
        handle = self._server.scene.add_transform_controls(
            HANDLE, scale=_HANDLE_SHARE * float(np.linalg.norm(np.subtract(*viewpoint(model)))),
            depth_test=False, wxyz=wxyz, position=position,
            translation_limits=((x0, x1), (y0, y1), (z0, z1)),
        )  # fmt: skip

        async def dragged(_: Any) -> None:
            self._held = True
            T_WO = np.eye(4)
            T_WO[:3, :3] = viser.transforms.SO3(np.asarray(handle.wxyz)).as_matrix()
            T_WO[:3, 3] = handle.position
            self._queue.move(self._which.value, T_WO)

        handle.on_update(dragged)
        return handle

    def _place(self, moment: Posed) -> Any:
        """(4, 4) of what is chosen to be dragged."""
        assert self._model is not None
        if self._which.value == HAND:
            assert moment.hand_W is not None
            return moment.hand_W
        return moment.solids_W[self._model.names.index(self._which.value)]

    async def _other(self, _: Any) -> None:
        self._held = False  # the handle goes to what is chosen

    def _let_go(self) -> None:
        self._held = False
        self._queue.want(release=True)

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


def first_grip(model: SceneModel) -> str:
    """What the handle begins at: a hand where there is one, else what is nearest to the tool."""
    if HAND in model.grips:
        return HAND
    hands = [name for name in model.grips if "hand" in name] or list(model.grips)
    far = np.linalg.norm(model.solids_W[:, :3, 3] - model.tool_W, axis=1)
    return min(hands, key=lambda name: float(far[model.names.index(name)]))


def pace(told: Update) -> str:
    """Whether it runs, and how far behind real time, where it is."""
    behind = f", {100.0 * told.real_time:.0f} % of real time" if told.real_time < 0.97 else ""
    return ("" if told.running else ", paused") + behind


def timing(told: Update, what: str) -> str:
    """What one `what` took, and how late they were."""
    late, latest = (us / 1e3 for us in told.late_us)
    return f"{what} {told.cpu_us:.0f} us of CPU, late by {late:.1f} ms (p99 {latest:.0f})"

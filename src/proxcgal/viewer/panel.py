"""Parts of a page's panel: controls, each registered with its allowed values, and the handle."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import viser
import viser.transforms

from proxcgal.sim.moment import Posed
from proxcgal.trial.walkthrough.operator_hand import HAND
from proxcgal.viewer.access import AccessControl
from proxcgal.viewer.client_messages import between, one_of, switch
from proxcgal.viewer.command_queue import ROOM, CommandQueue
from proxcgal.viewer.drawing import initial_viewpoint, pose_parts
from proxcgal.viewer.messages import Update
from proxcgal.viewer.scene_model import SceneModel

HANDLE = "/handle"
_HANDLE_SHARE = 0.1  # of the distance that a page begins to look from: large enough to be caught


class AllowedControls:
    """Adds controls to the panel at the right of a page."""

    def __init__(self, server: viser.ViserServer, access: AccessControl) -> None:
        """Docks the panel."""
        self._server, self._access = server, access
        server.gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
        server.gui.main_panel.dock_right()

    def add_button(self, label: str, work: Callable[[], None]) -> Any:
        """A button that does some work."""
        button = self._access.allow_control(self._server.gui.add_button(label), switch)

        async def clicked(_: Any) -> None:
            work()

        button.on_click(clicked)
        return button

    def add_buttons(self, label: str, work: Mapping[str, Callable[[], None]]) -> None:
        """A row of buttons, each with its work."""
        group = self._server.gui.add_button_group(label, tuple(work))
        self._access.allow_control(group, one_of(work))

        async def clicked(event: Any) -> None:
            work[event.target.value]()

        group.on_click(clicked)

    def add_list(self, label: str, options: Sequence[str], value: str) -> Any:
        """A list to choose from."""
        control = self._server.gui.add_dropdown(label, tuple(options), initial_value=value)
        return self._access.allow_control(control, one_of(options))

    def add_switch(self, label: str, value: bool, work: Callable[[bool], None] | None) -> Any:
        """A check box, with the work that each change of it does."""
        control = self._access.allow_control(self._server.gui.add_checkbox(label, value), switch)
        if work is not None:

            async def changed(event: Any) -> None:
                work(bool(event.target.value))

            control.on_update(changed)
        return control

    def add_slider(self, label: str, bounds: tuple[float, float, float], value: float) -> Any:
        """A slider; its least, most and step, which its value may widen."""
        low, high, step = min(bounds[0], value), max(bounds[1], value), bounds[2]
        control = self._server.gui.add_slider(label, low, high, step, value)
        return self._access.allow_control(control, between(low, high))


class Panel(AllowedControls):
    """Puts the commands of pages on the queue."""

    silent: frozenset[int] = frozenset()  #: rows of the sensors that give no scans

    def __init__(
        self, server: viser.ViserServer, access: AccessControl, queue: CommandQueue
    ) -> None:
        """Adds the status line and the buttons of the simulation."""
        super().__init__(server, access)
        self._queue = queue
        self._model: SceneModel | None = None
        self._of_model: list[Any] = []
        self._held = False
        self._status = server.gui.add_markdown("setting up ...")
        self.add_buttons(
            "simulation",
            {
                "run": lambda: queue.put(running=True),
                "pause": lambda: queue.put(running=False),
                "step": lambda: queue.put(running=False, steps=1),
                "reset": lambda: queue.put(reset=True),
            },
        )

    @property
    def shown(self) -> tuple[bool, bool, bool]:
        """Visibility of fields of view, filtered cloud, removed points."""
        return True, True, True

    def move_handle(self, update: Update) -> None:
        """Puts the handle where the dragged thing is, unless a page holds it."""
        moment = update.moment
        assert moment is not None
        if self._of_model and not self._held:
            handle = self._of_model[0]
            wxyz, position = pose_parts(self._place(moment))
            if not np.allclose(handle.position, position, atol=1e-4):
                handle.position = position
            if not np.allclose(handle.wxyz, wxyz, atol=1e-4):
                handle.wxyz = wxyz

    def status(self, update: Update, note: str) -> None:
        """Shows the state above the buttons, and a note."""
        lines = [] if update.moment is None else self._lines(update)
        if lines and note:
            lines.append(f"**{note}**")
        if lines or note:
            self._status.content = "  \n".join(lines) or note

    def _lines(self, update: Update) -> list[str]:
        """The state at a moment, in Markdown."""
        raise NotImplementedError

    def drop_handle(self) -> None:
        """No page holds the handle any more."""
        self._held = False

    def _dragging(self, model: SceneModel, title: str) -> None:
        """The handle, and the list of what it moves."""
        self._of_model.append(self._handle(model))
        folder = self._server.gui.add_folder(title)
        with folder:
            self._which = self.add_list(
                "drag", list(dict.fromkeys(model.draggable)), first_draggable(model)
            )
            self._which.on_update(self._other_chosen)
            self.add_button("let go", self._release)
        self._of_model.append(folder)

    def _handle(self, model: SceneModel) -> Any:
        (x0, y0, z0), (x1, y1, z1) = ROOM.tolist()
        name, T_W = first_draggable(model), np.eye(4)
        T_W[:3, 3] = model.tool_W
        if name in model.names:
            T_W = model.solids_W[model.names.index(name)]
        wxyz, position = pose_parts(T_W)
        away = float(np.linalg.norm(np.subtract(*initial_viewpoint(model))))
        handle = self._server.scene.add_transform_controls(
            HANDLE, scale=_HANDLE_SHARE * away, depth_test=False, wxyz=wxyz, position=position,
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

    async def _other_chosen(self, _: Any) -> None:
        self._held = False  # the handle goes to what is chosen

    def _release(self) -> None:
        self._held = False
        self._queue.put(release=True)


def first_draggable(model: SceneModel) -> str:
    """What the handle begins at: a hand where there is one, else what is nearest to the tool."""
    if HAND in model.draggable:
        return HAND
    hands = [name for name in model.draggable if "hand" in name] or list(model.draggable)
    far = np.linalg.norm(model.solids_W[:, :3, 3] - model.tool_W, axis=1)
    return min(hands, key=lambda name: float(far[model.names.index(name)]))


def pace(update: Update) -> str:
    """Whether it runs, and how far behind real time, where it is."""
    behind = f", {100.0 * update.real_time:.0f} % of real time" if update.real_time < 0.97 else ""
    return ("" if update.running else ", paused") + behind


def timing(update: Update, what: str) -> str:
    """What one `what` took, and how late they were."""
    late, latest = (us / 1e3 for us in update.late_us)
    return f"{what} {update.cpu_us:.0f} us of CPU, late by {late:.1f} ms (p99 {latest:.0f})"

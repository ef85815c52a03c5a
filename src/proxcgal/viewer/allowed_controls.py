"""Controls of a page: each is registered in the access control with the values that it may have."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import viser

from proxcgal.viewer.access import AccessControl
from proxcgal.viewer.client_messages import between, one_of, switch


class AllowedControls:
    """Adds controls to the panel at the right of a page."""

    def __init__(self, server: viser.ViserServer, access: AccessControl) -> None:
        """Docks the panel."""
        self._server, self._access = server, access
        server.gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
        server.gui.main_panel.dock_right()

    def add_button(self, label: str, work: Callable[[], None]) -> Any:
        """A button that does some work."""
        button = self._server.gui.add_button(label)
        self._access.allow_control(button, switch)

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
        self._access.allow_control(control, one_of(options))
        return control

    def add_switch(self, label: str, value: bool, work: Callable[[bool], None] | None) -> Any:
        """A check box, with the work that each change of it does."""
        control = self._server.gui.add_checkbox(label, value)
        self._access.allow_control(control, switch)
        if work is not None:

            async def changed(event: Any) -> None:
                work(bool(event.target.value))

            control.on_update(changed)
        return control

    def add_slider(self, label: str, bounds: tuple[float, float, float], value: float) -> Any:
        """A slider; its least, most and step, which its value may widen."""
        low, high, step = min(bounds[0], value), max(bounds[1], value), bounds[2]
        control = self._server.gui.add_slider(label, low, high, step, value)
        self._access.allow_control(control, between(low, high))
        return control

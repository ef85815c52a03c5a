"""A live page in a real browser, and a mouse that drags its handle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import viser.transforms
from browser import Tab, pixel, until

from proxcgal.scenario.loading import load_scenario
from proxcgal.viewer.live_page import LivePage
from proxcgal.viewer.page_server import close, serve
from proxcgal.viewer.panel import HANDLE


class Live:
    """A live page of a scene, open in a browser."""

    def __init__(self, name: str, folder: Path, open_tab: Callable[[], Tab], ready: str) -> None:
        self.folder = folder
        self.scenario = load_scenario(name)
        self.server, self.access = serve("127.0.0.1", 0, label=f"proxcgal: {name}")
        self.page = LivePage(self.server, self.access, self.scenario, "wb")
        self.address = f"http://127.0.0.1:{self.server.get_port()}/"
        assert until(lambda: self.page.last.moment is not None)
        self.open_tab = open_tab
        self.tab = open_tab()
        self.tab.open(self.address)
        assert until(lambda: len(self.server.get_clients()) == 1)
        self.tab.page.get_by_text(ready).first.wait_for()

    @property
    def moment(self) -> Any:
        assert self.page.last.moment is not None
        return self.page.last.moment

    @property
    def activation(self) -> tuple[Any, Any]:
        """The curve that the page draws: times [s] and values."""
        time, activation = self.page._panel.plots._activation.data
        return np.asarray(time), np.asarray(activation)

    @property
    def camera(self):  # type: ignore[no-untyped-def]
        return next(iter(self.server.get_clients().values())).camera

    def passed(self, seconds: float) -> None:
        """Waits for that much simulated time."""
        end = self.moment.elapsed + seconds
        assert until(lambda: self.moment.elapsed >= end)

    def press(self, label: str) -> None:
        self.tab.page.get_by_role("button", name=label, exact=True).first.click()

    def drag(self, way: Sequence[float], seconds: float = 0.6) -> None:
        """Takes the handle with the mouse and moves it along one axis of the world [m].

        The button stays down. A page that draws slowly may not know yet that the mouse is there:
        then it is tried again.
        """
        handle = self.server.scene._handle_from_transform_controls_name[HANDLE]
        mouse = self.tab.page.mouse
        for _ in range(4):
            R_WH = viser.transforms.SO3(np.asarray(handle.wxyz)).as_matrix()
            begin = np.array(handle.position)
            axis = int(np.abs(R_WH.T @ np.asarray(way, float)).argmax())
            start = (
                begin + 0.65 * handle.scale * R_WH[:, axis]
            )  # on the handle's arrow along that axis
            (x0, y0), (x1, y1) = pixel(self.camera, start), pixel(self.camera, start + way)
            mouse.move(x0 + 1.0, y0)
            mouse.move(x0, y0)
            self.tab.frames(2)
            mouse.down()
            self.tab.frames(1)
            steps = max(round(seconds / 0.04), 1)
            for share in np.arange(1, steps + 1) / steps:
                mouse.move(x0 + share * (x1 - x0), y0 + share * (y1 - y0))
                self.tab.page.wait_for_timeout(1000.0 * seconds / steps)
            if until(lambda: np.linalg.norm(handle.position - begin) > 0.05, 10.0):  # noqa: B023
                return
            mouse.up()
        raise AssertionError("the handle can't be dragged")

    def close(self) -> None:
        self.tab.page.close()
        self.page.close()
        close(self.server)

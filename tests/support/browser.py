"""A real Chromium without a screen, in a user folder of its own; what it asked for is kept."""

from __future__ import annotations

import os
import shutil
import tempfile
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

FLAGS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
]  # fmt: skip
#: Pictures that the tests make are kept here, where it is set.
PICTURES = os.environ.get("PROXCGAL_PICTURES")
PATIENCE = 120.0  # [s] for what has to come, however busy the machine is
SIZE = (1100, 680) if PICTURES else (800, 520)  # [px]


class Tab:
    """One page, with all requests, console errors and exceptions since it was opened."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.requests: list[str] = []
        self.errors: list[str] = []
        page.on("request", lambda request: self.requests.append(request.url))
        page.on("websocket", lambda socket: self.requests.append(socket.url))
        page.on("requestfailed", lambda request: self.errors.append(f"failed: {request.url}"))
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("console", self._heard)

    def open(self, address: str) -> None:
        self.page.goto(address)

    def picture(self, name: str, folder: Path) -> Path:
        path = Path(PICTURES or folder) / f"{name}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        for note in self.page.locator(".mantine-Notification-closeButton").all():
            note.click()  # that it renders in software
        self.page.screenshot(path=str(path))
        return path

    def frames(self, count: int) -> None:
        """Waits until so many were drawn."""
        script = """(count) => new Promise(done => {
            function next() { if (count-- <= 0) done(); else requestAnimationFrame(next); }
            next(); })"""
        self.page.evaluate(script, count)

    def frames_per_second(self, seconds: float) -> float:
        script = """(seconds) => new Promise(done => {
            let frames = 0; const start = performance.now();
            function count() {
                frames += 1;
                const passed = (performance.now() - start) / 1000;
                if (passed > seconds) done(frames / passed); else requestAnimationFrame(count);
            }
            requestAnimationFrame(count); })"""
        return float(self.page.evaluate(script, seconds))

    def _heard(self, message: Any) -> None:
        if message.type == "error":
            self.errors.append(message.text)


@contextmanager
def chromium(width: int = SIZE[0], height: int = SIZE[1]) -> Iterator[Callable[[], Tab]]:
    """Opens tabs of one browser; skips the test where there is none."""
    program = shutil.which("chromium")
    playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright")
    if program is None:
        pytest.skip("needs chromium: apt-get install chromium")
    with playwright.sync_playwright() as driver, tempfile.TemporaryDirectory() as user:
        context = driver.chromium.launch_persistent_context(
            user, executable_path=program, args=FLAGS,
            viewport={"width": width, "height": height},
        )  # fmt: skip
        context.set_default_timeout(1000.0 * PATIENCE)
        try:
            yield lambda: Tab(context.new_page())
        finally:
            context.close()


def until(condition: Callable[[], Any], seconds: float = PATIENCE) -> bool:
    """Waits until it is so; false where it never came to that."""
    end = clock.monotonic() + seconds
    while clock.monotonic() < end:
        if condition():
            return True
        clock.sleep(0.05)
    return False


def pixel(camera: Any, point_W: Any) -> tuple[float, float]:
    """Where a viewer with viser's camera sees a point."""
    import viser.transforms

    R_WC = viser.transforms.SO3(camera.wxyz).as_matrix()
    x, y, z = R_WC.T @ (np.asarray(point_W) - camera.position)
    scale = 0.5 * camera.image_height / np.tan(0.5 * camera.fov)
    return 0.5 * camera.image_width + scale * x / z, 0.5 * camera.image_height + scale * y / z

"""The live page in a real browser: what is dragged and switched there reaches the arm."""

from collections.abc import Callable, Iterator
from urllib.parse import urlsplit

import numpy as np
import pytest
from browser import Tab, until
from live import Live

from proxcgal.viewer.page_server import close, serve


@pytest.fixture(scope="module")
def live(open_tab: Callable[[], Tab], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    folder = tmp_path_factory.mktemp("page")
    live = Live("front_plane", folder, open_tab, "activation of avoidance")
    try:
        yield live
    finally:
        live.close()


def test_the_page_asks_no_other_host_for_anything(live: Live) -> None:
    live.passed(1.0)
    hosts = {urlsplit(url.removeprefix("blob:")).netloc for url in live.tab.requests}
    assert hosts == {urlsplit(live.address).netloc}
    assert live.tab.errors == []
    assert live.access.dropped == 0  # the gate knows all that a real page sends
    live.tab.picture("page", live.folder)


def test_dragging_the_obstacle_to_the_flange_raises_activation_and_the_arm_goes_away(
    live: Live,
) -> None:
    assert until(lambda: live.moment.elapsed > 4.0)
    before, tool = live.moment, live.moment.links_W[-1][:3, 3]
    live.drag((-0.4, 0.0, 0.0))
    highest = before.activation

    def went_away() -> bool:
        nonlocal highest
        time, activation = live.activation  # drawn: the peak may be over when the mouse is there
        highest = max(highest, activation[time > before.elapsed].max(initial=0.0))
        return bool(live.moment.links_W[-1][0, 3] < tool[0] - 0.1)

    assert until(went_away)
    live.passed(0.5)
    live.tab.picture("dragged", live.folder)
    live.tab.page.mouse.up()
    assert live.moment.solids_W[0][0, 3] < before.solids_W[0][0, 3] - 0.15
    assert highest > before.activation + 0.2


def test_a_sensor_that_is_switched_off_leaves_the_cloud(live: Live) -> None:
    page = live.tab.page
    before = live.moment
    assert len(before.held_W) == 0
    page.get_by_text("sensors", exact=True).click()
    for row in (1, 2, 3):
        page.get_by_label(f"forearm_link/ring2/{row}", exact=True).click()
    assert until(lambda: live.page._panel.silent == {21, 22, 23})

    def held() -> bool:
        """What they saw last stays; the simulation hears of the last of them a little later."""
        before = live.moment.held_W
        live.passed(0.3)
        return len(before) > 5 and np.array_equal(live.moment.held_W, before)

    assert until(held)
    assert len(live.moment.kept_W) < len(before.kept_W)
    assert live.moment.mode > 0
    live.tab.picture("silent", live.folder)


def test_a_slider_changes_the_law_and_the_arm_goes_on_where_it_is(live: Live) -> None:
    live.press("pause")
    assert until(lambda: not live.page.last.running)
    q = live.moment.q
    slider = live.tab.page.get_by_role("slider").first
    slider.focus()
    slider.press("ArrowRight")
    slider.press("ArrowRight")
    wanted = live.scenario.controller.d_min + 0.02
    assert until(lambda: live.page.bounds[0] == pytest.approx(wanted))
    drawn = live.page.drawn
    assert until(lambda: live.page.drawn > drawn + 1)  # of the new law
    assert np.abs(live.moment.q - q).max() < 0.01
    live.press("run")
    assert until(lambda: live.page.last.running)


def test_reset_and_pause_are_heard(live: Live) -> None:
    live.press("pause")
    assert until(lambda: not live.page.last.running)
    live.press("reset")
    assert until(lambda: live.moment.elapsed < 1.0)
    assert np.allclose(live.moment.q, live.scenario.q0)
    live.press("step")
    assert until(lambda: 0.0 < live.moment.elapsed < 0.1)


def test_a_second_viewer_sees_the_same_and_leaves_nothing_behind(live: Live) -> None:
    tab = live.open_tab()
    tab.open(live.address)
    assert until(lambda: live.access.viewers == 2)
    tab.page.get_by_text("paused").wait_for()
    assert tab.errors == []
    tab.page.close()
    assert until(lambda: live.access.viewers == 1)
    assert len(live.server.get_clients()) == 1


def test_a_browser_needs_the_token_and_keeps_it(open_tab: Callable[[], Tab]) -> None:
    token = "correct-horse-battery"
    server, access = serve("127.0.0.1", 0, label="guarded", token=token)
    server.gui.add_markdown("inside")
    address = f"http://127.0.0.1:{server.get_port()}/"
    try:
        tab = open_tab()
        tab.open(address)
        assert "a token is needed" in tab.page.content()
        assert access.viewers == 0
        tab.open(f"{address}?token={token}")
        tab.page.get_by_text("inside").wait_for()
        assert access.viewers == 1
        tab.page.close()
    finally:
        close(server)

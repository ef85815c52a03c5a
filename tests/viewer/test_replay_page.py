"""A recording in the browser: the time line moves the arm, other settings are shown beside it."""

import asyncio
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from browser import Tab, until

from proxcgal.recording.reader import Recording, read_recording
from proxcgal.recording.writer import Recorder
from proxcgal.scenario.loading import load_scenario
from proxcgal.trial.trial import run_trial
from proxcgal.viewer.page_server import close, serve
from proxcgal.viewer.replay_moments import replay_moments
from proxcgal.viewer.replay_page import ReplayPage, comparison_text


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    path = tmp_path_factory.mktemp("recording") / "wb.mcap"
    with Recorder(path) as recorder:
        run_trial(load_scenario("front_plane", ["duration=2.0"]), "wb", recorder=recorder)
    return read_recording(path)


def test_a_recording_is_shown_as_recorded_and_says_so(recording: Recording) -> None:
    run = replay_moments(recording, 15.0)
    assert run.same is None
    assert comparison_text(run, None) == "200 ticks, shown as recorded"
    assert len(run.moments[-1].kept_W) == recording.ticks[-1].result.cloud_points


def test_an_older_recording_is_recomputed_bit_for_bit_and_says_so(recording: Recording) -> None:
    run = replay_moments(replace(recording, cloud_messages=()), 15.0)
    assert run.same == run.ticks == 200
    assert "all 200 answers are those recorded, bit for bit" in comparison_text(run, None)
    assert run.moments[0].elapsed == 0.0
    assert run.moments[-1].elapsed == pytest.approx(1.99)
    shown = replay_moments(recording, 15.0)
    for then, now in zip(shown.moments, run.moments, strict=True):
        assert then.elapsed == now.elapsed
        assert then.kept_W.tobytes() == now.kept_W.tobytes()
        assert then.removed_W.tobytes() == now.removed_W.tobytes()


def test_other_settings_are_compared_with_what_was_recorded(recording: Recording) -> None:
    run = replay_moments(recording, 15.0)
    again = replay_moments(recording, 15.0, "sm", ["controller.d_min=0.4"], ahead=True)
    assert again.same is not None
    assert again.same < again.ticks
    assert "as sm with what was asked for" in comparison_text(run, again)
    for then, now in zip(run.moments, again.moments, strict=True):
        assert np.array_equal(then.q, now.q)


def test_the_time_line_scrubs(
    recording: Recording, open_tab: Callable[[], Tab], tmp_path: Path
) -> None:
    run = replay_moments(recording, 15.0)
    again = replay_moments(recording, 15.0, "sm", ahead=True)
    server, access = serve("127.0.0.1", 0, label="replay")
    page = ReplayPage(server, access, run, again, comparison_text(run, again))
    try:
        tab = open_tab()
        tab.open(f"http://127.0.0.1:{server.get_port()}/")
        line = tab.page.get_by_role("slider").first
        line.wait_for()
        tab.page.get_by_text("shown as recorded").wait_for()
        assert page.row == 0
        line.focus()
        line.press("End")
        assert until(lambda: page.row == len(run.moments) - 1)
        tab.page.get_by_text("at 1.99 s").wait_for()
        shown = [np.array(handle.position) for handle in page._drawings[0]._links]
        assert np.allclose(shown, run.moments[-1].links_W[:, :3, 3])
        tab.picture("replay", tmp_path)
        tab.page.get_by_role("button", name="back", exact=True).click()
        assert until(lambda: page.row == len(run.moments) - 2)
        line.press("Home")
        assert until(lambda: page.row == 0)
        tab.page.get_by_role("button", name="play", exact=True).click()
        assert until(lambda: page.row > 5)
        assert tab.errors == []
        assert access.dropped == 0
        tab.page.close()
    finally:
        page.close()
        close(server)


def test_the_buttons_go_from_moment_to_moment_whatever_the_tick(tmp_path: Path) -> None:
    scenario = load_scenario("front_plane", ["duration=0.5", "simulation.control_hz=250.0"])
    with Recorder(tmp_path / "wb.mcap") as recorder:
        run_trial(scenario, "wb", recorder=recorder)
    run = replay_moments(read_recording(tmp_path / "wb.mcap"), 15.0)
    server, access = serve("127.0.0.1", 0, label="replay")
    page = ReplayPage(server, access, run, None, "")

    async def nothing() -> None: ...

    def press(button: str) -> int:
        page._press(button)
        loop = page._line._impl.gui_api._event_loop  # where the time line's change is heard
        asyncio.run_coroutine_threadsafe(nothing(), loop).result(60.0)
        return page.row

    try:
        last = len(run.moments) - 1
        assert [press("next") for _ in range(last)] == list(range(1, last + 1))
        assert [press("back") for _ in range(last)] == list(range(last - 1, -1, -1))
    finally:
        page.close()
        close(server)


def test_the_command_serves_a_recording_until_it_is_interrupted(recording: Recording) -> None:
    program = "import sys; from proxcgal.cli.main import main; sys.exit(main())"
    options = ["replay", str(recording.path), "--view", "--port", "0"]
    command = [sys.executable, "-c", program, *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        lines = [process.stdout.readline() for _ in range(2)]
        process.terminate()
    assert "shown as recorded" in lines[0]
    assert lines[1].startswith("http://127.0.0.1:")

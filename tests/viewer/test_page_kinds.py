"""Live pages of the other kinds of scene: what is dragged there does what docs/page.md says."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from browser import Tab, until
from live import Live

from proxcgal.evaluation.ground_truth import GroundTruth
from proxcgal.scenario.setup import Setup
from proxcgal.viewer.walkthrough_panel import ENABLE


@contextmanager
def opened(
    name: str, folder: Path, open_tab: Callable[[], Tab], ready: str = "activation of avoidance"
) -> Iterator[Live]:
    live = Live(name, folder, open_tab, ready)
    try:
        yield live
        live.tab.picture(name, folder)
        assert live.tab.errors == []
        assert live.access.dropped == 0
    finally:
        live.close()


def test_a_hand_drags_the_tool_of_a_walk_through_and_a_fast_one_trips_the_guard(
    open_tab: Callable[[], Tab], tmp_path: Path
) -> None:
    with opened("walkthrough_teach", tmp_path, open_tab, "TORQUE OFF") as live:
        page = live.tab.page
        assert live.moment.state == "off"  # nothing switches on by itself
        page.get_by_role("button", name=ENABLE).click()
        page.get_by_text("TORQUE ON").wait_for()
        live.passed(0.3)
        tool = live.moment.links_W[-1][:3, 3].copy()

        live.drag((-0.15, 0.0, 0.0), seconds=1.0)
        assert until(lambda: live.moment.links_W[-1][0, 3] < tool[0] - 0.1)
        page.mouse.up()
        live.passed(0.5)
        assert (live.moment.state, live.moment.trips) == ("on", 0)

        live.drag((-0.7, 0.0, 0.0), seconds=0.0)  # in one leap
        assert until(lambda: live.moment.trips == 1)
        page.mouse.up()
        page.get_by_text(live.moment.trip).wait_for()
        page.get_by_text("brakes hold: tripped").wait_for()
        assert until(lambda: live.moment.state == "off" and not live.moment.gripped)
        live.passed(0.3)
        stood = live.moment.q
        live.passed(1.0)
        assert live.moment.state == "off"
        assert np.abs(live.moment.q - stood).max() < 0.005

        page.get_by_role("button", name=ENABLE).click()
        page.get_by_text("TORQUE ON").wait_for()
        assert live.moment.trips == 1


def test_a_person_s_hand_that_is_dragged_is_what_true_distances_run_to(
    open_tab: Callable[[], Tab], tmp_path: Path
) -> None:
    with opened("hri_task1", tmp_path, open_tab) as live:
        stage = live.page._drawing.model  # type: ignore[union-attr]
        door = stage.names.index("door")
        assert "door" not in stage.draggable
        assert live.moment.solids_W.shape == (len(stage.names), 4, 4)
        assert np.allclose(live.moment.solids_W[door][:3, 3], [1.21, 0.0, 0.15])
        hand = stage.names.index(live.page._panel._which.value)
        live.press("pause")
        assert until(lambda: not live.page.last.running)
        before = live.moment.solids_W[hand][:3, 3].copy()
        live.drag((0.0, 0.0, 0.2))
        live.tab.page.mouse.up()
        live.press("run")
        assert until(lambda: live.moment.solids_W[hand][2, 3] > before[2] + 0.05)
        live.press("pause")
        assert until(lambda: not live.page.last.running)
        setup, moment = Setup.of(live.scenario), live.moment
        rows = [stage.names.index(name) for name in setup.measured.names]
        shown = Posed(setup.measured, moment.solids_W[rows])
        assert abs(GroundTruth(setup.robot, shown).nearest(moment.q).distance - moment.true) < 1e-6


def test_an_obstacle_that_is_dragged_before_the_joint_robot_is_known_there(
    open_tab: Callable[[], Tab], tmp_path: Path
) -> None:
    with opened("joint_gate", tmp_path, open_tab) as live:
        row = live.page._drawing.model.names.index(live.page._panel._which.value)  # type: ignore[union-attr]
        before, q = live.moment, live.moment.q
        live.drag((-0.4, 0.0, 0.0))
        live.tab.page.mouse.up()
        assert until(lambda: live.moment.solids_W[row][0, 3] < before.solids_W[row][0, 3] - 0.2)
        assert live.moment.seen < before.seen
        assert np.abs(live.moment.q - q).max() > 0.0


class Posed:
    """A scene that stands as it is shown."""

    still = True

    def __init__(self, scene, solids_W) -> None:  # type: ignore[no-untyped-def]
        self.names, self.solids, self._solids_W = scene.names, scene.solids, solids_W

    def poses(self, time: float):  # type: ignore[no-untyped-def]
        return self._solids_W

    def twists(self, time: float):  # type: ignore[no-untyped-def]
        return np.zeros((len(self.solids), 6))

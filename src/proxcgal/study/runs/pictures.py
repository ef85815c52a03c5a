"""What a run is shown as: jobs that draw a folder's figures and its moving picture."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from proxcgal.core.errors import SimulationError
from proxcgal.core.files import write_bytes
from proxcgal.core.progress import OnProgress
from proxcgal.evaluation.trial_log import TrialLog
from proxcgal.recording.reader import read_recording
from proxcgal.scenario.hri_scenario import HriScenario
from proxcgal.scenario.scenario import Scenario
from proxcgal.scenario.setup import Setup
from proxcgal.study.motion_picture import MOVING, STILL, bearing_for, motion_picture
from proxcgal.study.pair_figure import pair_figure, sensor_view, whole_body_view
from proxcgal.study.plotting import Signals, png
from proxcgal.study.time_figure import time_figure

DRAWN_SPACING_M = 0.03  # [m] between the obstacle's points in a figure
SIDE_BY_SIDE = ("wb", "sm")  # controllers in the moving picture


def draw_figures(
    scenario: Scenario, logs: Sequence[TrialLog], folder: Path, report: OnProgress
) -> str:
    """Draws `distance.png` and, where a posture shows a pair, `pairs.png`; what was drawn."""
    settings = scenario.controller
    title = f"{scenario.name}: {logs[0].robot}, seed {logs[0].seed}"
    signals: Signals = ()
    if isinstance(scenario, HriScenario):
        signals = scenario.signals()
        title += f", {scenario.operator.who}"
    figure = time_figure(
        logs, title=title, d_min=settings.d_min, buffer=settings.buffer, signals=signals,
        links=Setup.of(scenario).robot.link_names,
        faults=[(f.start, scenario.duration if f.end is None else f.end) for f in scenario.faults],
    )  # fmt: skip
    write_bytes(folder / "distance.png", png(figure))
    report(0.5)
    return f"{scenario.name}: distance.png" + _draw_pairs(scenario, logs, folder)


def _draw_pairs(scenario: Scenario, logs: Sequence[TrialLog], folder: Path) -> str:
    """On the posture of the whole-body run at which it was nearest to what it saw."""
    setup = Setup.of(scenario)
    if not setup.scene.solids:
        return ""
    log = next((log for log in logs if log.controller == "wb"), logs[0])
    tick = int(np.argmin(log.true_m))
    elapsed = float(log.elapsed[tick])
    points_W = setup.known_cloud()(elapsed)
    q, drawn = log.q[tick], setup.known_cloud(DRAWN_SPACING_M)(elapsed)
    views = []
    if any(each.controller != "sm" for each in logs):
        views.append(
            whole_body_view(setup.robot, q, points_W, drawn_W=drawn, title="whole body (WB)")
        )
    if any(each.controller == "sm" for each in logs):
        views.append(
            sensor_view(
                setup.robot, setup.skin, q, points_W, drawn_W=drawn, title="sensor points (SM)"
            )
        )
    title = (
        f"{scenario.name}: closest pairs on one posture ({log.controller}, {log.time[tick]:.1f} s)"
    )
    write_bytes(
        folder / "pairs.png", png(pair_figure([views], title=title, bearing=bearing_for(setup)))
    )
    return ", pairs.png"


def draw_motion(scenario: Scenario, folder: Path, report: OnProgress) -> str:
    """Draws `motion.gif` and `motion.png` from the folder's recordings; what was drawn, or why not.

    A machine that cannot draw off screen still gets all its numbers and figures.
    """
    files = [folder / f"{name}.mcap" for name in SIDE_BY_SIDE]
    recordings = [read_recording(path) for path in files if path.is_file()]
    if not recordings:
        return f"{scenario.name}: no {MOVING}: neither {' nor '.join(SIDE_BY_SIDE)} was run"
    try:
        motion_picture(recordings, folder, report)
    except SimulationError as error:
        return f"{scenario.name}: no {MOVING}: {error}"
    return f"{scenario.name}: {MOVING}, {STILL}"

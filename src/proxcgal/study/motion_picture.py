"""A moving picture of recorded runs: side by side, under one caption each."""

import bisect
import functools
import shutil
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import get_data_path
from PIL import Image, ImageDraw, ImageFont

from proxcgal.core.errors import ProxError
from proxcgal.core.progress import OnProgress, ProgressBar
from proxcgal.recording.reader import Recording, read_recording
from proxcgal.recording.render import RecordedMoment, draw, recorded_moments, write_gif
from proxcgal.scenario.hri_scenario import HriScenario
from proxcgal.scenario.setup import Setup
from proxcgal.scene.solids import Box
from proxcgal.sim.picture import Camera
from proxcgal.sim.world import World
from proxcgal.study.campaign import Trial
from proxcgal.study.plotting import CONTROLLER_COLOURS, CONTROLLER_NAMES, GREY
from proxcgal.study.trial_simulation import simulate_trial
from proxcgal.study.workers import Pool

MOVING, STILL = "motion.gif", "motion.png"
DRAWING = ".drawing-"  # begins the name of a folder of unfinished files
FPS = 8.0
FRAMES = 50  # of the run; the last one is then held
HELD = 8
PANE = (400, 360)  # [px] width and height of one run's picture
STRIP = 48  # [px] of text below it


def motion_picture(
    recordings: Sequence[Recording],
    folder: Path,
    on_progress: Callable[[float], None] = lambda _: None,
) -> None:
    """Writes a GIF of one scene under several controllers, side by side, and one frame of it.

    The frame, a PNG, is the last one; beside a person, the moment of the least true distance of all
    runs. Both files are whole, or not there.

    Args:
        recordings: of one scenario; their ticks are repeated, which gives the clouds.
        folder: gets `motion.gif` and `motion.png`.
        on_progress: called with the share done, 0 to 1.

    Raises:
        SimulationError: there is no way to draw off screen.
    """
    setup = Setup.of(recordings[0].settings.scenario)
    times = np.linspace(0.0, max(r.ticks[-1].inputs.time for r in recordings), FRAMES).tolist()
    time_shown, nearest = _time_shown(setup, recordings)
    stills = bisect.bisect_left(times, time_shown)  # where the still's moment stands among them
    times.insert(stills, time_shown)
    seen = [recorded_moments(recording, times) for recording in recordings]
    camera = camera_for(setup)
    world = World(setup.robot, setup.scenario.drawn(), setup.scenario.floor, setup.scene.names)
    frames = []
    try:
        for row, moment in enumerate(zip(*seen, strict=True)):
            frame = Image.new("RGB", (PANE[0] * len(recordings), PANE[1] + STRIP), "white")
            for column, (snapshot, recording) in enumerate(zip(moment, recordings, strict=True)):
                note = "  (the least)" if row == stills and column == nearest else ""
                frame.paste(_pane(world, camera, snapshot, recording, note), (column * PANE[0], 0))
            frames.append(frame)
            on_progress((row + 1) / len(times))
    finally:
        world.close()
    with tempfile.TemporaryDirectory(prefix=DRAWING, dir=folder) as half:
        frames.pop(stills).save(Path(half) / STILL, optimize=True)
        write_gif(frames + frames[-1:] * HELD, Path(half) / MOVING, FPS)
        for name in (MOVING, STILL):
            (Path(half) / name).replace(folder / name)


def _time_shown(setup: Setup, recordings: Sequence[Recording]) -> tuple[float, int]:
    """The moment [s] that shows most, and which run came nearest then, -1 where none is named.

    The end; beside a person, who comes and in the end is gone, the least distance of all runs.
    """
    if isinstance(setup.scenario, HriScenario):
        least = [
            (tick.truth.distance, run, tick.inputs.time)
            for run, recording in enumerate(recordings)
            for tick in recording.ticks
            if np.isfinite(tick.truth.distance)
        ]
        if least:
            _, run, time = min(least)
            return time, run
    return max(recording.ticks[-1].inputs.time for recording in recordings), -1


def camera_for(setup: Setup) -> Camera:
    """A camera that has the arm and the first obstacle in view."""
    if isinstance(setup.scenario, HriScenario):
        left = setup.scenario.on_the_left
        return Camera(
            lookat_W=(0.5, 0.3 if left else -0.3, 0.0), distance=3.0,
            azimuth=float(np.deg2rad(-20.0 if left else 20.0)), elevation=float(np.deg2rad(-30.0)),
        )  # fmt: skip
    if not setup.scene.solids:
        return Camera()
    tool_W = np.asarray(setup.robot.tool_pose(setup.q0))[:3, 3]
    middle = 0.5 * (tool_W + setup.scene.poses(0.0)[0][:3, 3])
    return Camera(
        lookat_W=(0.6 * float(middle[0]), 0.6 * float(middle[1]), 0.42),
        distance=1.95,
        azimuth=bearing_for(setup) + float(np.pi),  # of its line of sight
        elevation=float(np.deg2rad(-18.0)),
    )


def bearing_for(setup: Setup) -> float:
    """From where to look at the scene, counter-clockwise from x, seen from above [rad].

    Along the first obstacle's face and a little from the arm's side, so that it hides nothing.
    """
    if isinstance(setup.scenario, HriScenario):  # from behind the arm, on the person's side
        return float(np.deg2rad(150.0 if setup.scenario.on_the_left else -150.0))
    solid, T_WO = setup.scene.solids[0], setup.scene.poses(0.0)[0]
    tool_W = np.asarray(setup.robot.tool_pose(setup.q0))[:3, 3]
    to_tool_W = tool_W - T_WO[:3, 3]
    normal_W = T_WO[:3, int(solid.extent.argmin())] if isinstance(solid, Box) else to_tool_W
    away = normal_W if to_tool_W @ normal_W > 0.0 else -normal_W
    return float(np.arctan2(away[1], away[0]) + np.deg2rad(78.0))


def _pane(
    world: World, camera: Camera, snapshot: RecordedMoment, recording: Recording, note: str
) -> Image.Image:
    controller, scenario = recording.settings.controller, recording.settings.scenario
    picture = Image.new("RGB", (PANE[0], PANE[1] + STRIP), "white")
    picture.paste(Image.fromarray(draw(world, snapshot, PANE, camera)), (0, 0))
    pen = ImageDraw.Draw(picture)
    colour = CONTROLLER_COLOURS.get(controller, "black")
    pen.rectangle((0, PANE[1], PANE[0], PANE[1] + 3), fill=colour)
    top = PANE[1] + 8
    pen.text(
        (10, top), CONTROLLER_NAMES.get(controller, controller), font=_font(bold=True), fill=colour
    )
    true = 1000.0 * snapshot.tick.truth.distance
    if isinstance(scenario, HriScenario):
        who = f"{scenario.name}, {scenario.operator.who}"
        pen.text((PANE[0] - 10, top), who, font=_font(), fill=GREY, anchor="ra")
    text = f"t = {snapshot.tick.inputs.time:.1f} s    true distance {true:.0f} mm{note}"
    pen.text((10, top + 18), text, font=_font(), fill="black")
    return picture


def _font(*, bold: bool = False) -> Any:
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(Path(get_data_path()) / "fonts" / "ttf" / name, 14)


def draw_moving(trials: Sequence[Trial], folder: Path, pool: Pool, *, quiet: bool) -> None:
    """Draws `motion.gif` and one of its frames into a campaign's folder, unless they are there.

    A machine that cannot draw off screen gets all the rest.

    Args:
        trials: of one scene, one after the other from the left.
        folder: of the campaign, which is of one build: what is there is of these trials.
        pool: a worker of this machine draws.
        quiet: no progress on stderr.
    """
    for half in folder.glob(f"{DRAWING}*"):  # of a process that was killed
        shutil.rmtree(half, ignore_errors=True)
    if not trials or (folder / MOVING).is_file():
        return
    with ProgressBar("drawing", [1.0], "", quiet=quiet) as progress:
        pool.run(
            [functools.partial(_draw, list(trials), folder)],
            progress.shares, lambda _, text: progress.finished(text), lambda *_: "no picture",
        )  # fmt: skip


def _draw(trials: Sequence[Trial], folder: Path, report: OnProgress) -> str:
    steps = len(trials) + 1
    with tempfile.TemporaryDirectory(prefix=DRAWING, dir=folder) as half:
        try:
            recordings = []
            for row, trial in enumerate(trials):
                path = Path(half) / f"{row}.mcap"

                def part(share: float, done: int = row) -> None:
                    report((done + share) / steps)

                log = simulate_trial(
                    trial.scenario, trial.controller, trial.seed, part, recording=path
                )
                if log.recording_failure:
                    return f"no {MOVING}: {log.recording_failure}"
                recordings.append(read_recording(path))
            motion_picture(recordings, folder)
        except ProxError as error:
            return f"no {MOVING}: {error}"
    return MOVING

"""A campaign's moving picture: some of its trials run again, side by side."""

import functools
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

from proxcgal.core.errors import ProxError
from proxcgal.core.progress import OnProgress, ProgressBar
from proxcgal.recording.reader import read_recording
from proxcgal.study.campaign import Trial
from proxcgal.study.motion_picture import DRAWING, MOVING, motion_picture
from proxcgal.study.trial_simulation import simulate_trial
from proxcgal.study.workers import Pool


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

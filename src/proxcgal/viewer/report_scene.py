"""3D scenes of a report: recorded runs that play, and a scene that stands still."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from proxcgal.core.errors import ConfigError
from proxcgal.recording.reader import read_recording
from proxcgal.scenario.loading import load_scenario
from proxcgal.trial.interactive import LiveTrial
from proxcgal.viewer.export import ArmMotion, exported_scene
from proxcgal.viewer.replay_moments import ReplayedRun, replay_moments
from proxcgal.viewer.scene_model import SceneModel

_HZ = 10.0  # moments a second, where the run is short
_MOMENTS = 150  # at most
_SEEN_AFTER = 0.2  # [s] by then every sensor has measured


def replay_scene(files: Sequence[Path]) -> tuple[bytes, tuple[str, ...]]:
    """Recorded runs of one scene, the first drawn whole, the others see-through beside it.

    Args:
        files: the recordings.

    Returns:
        What viser's client plays; the controllers, in the order of the files.

    Raises:
        ProxError: a recording that cannot be read or repeated.
    """
    recordings = [read_recording(path) for path in files]
    if empty := [str(r.path) for r in recordings if not r.ticks]:
        raise ConfigError(f"{', '.join(empty)}: holds no tick")
    ends = [len(r.ticks) / r.settings.scenario.simulation.control_hz for r in recordings]
    hz = min(_HZ, _MOMENTS / max(ends))
    runs = [replay_moments(recording, hz) for recording in recordings]
    played = _together(runs)
    return exported_scene(played[0], played[1:]), tuple(run.controller for run in runs)


def still_scene(name: str) -> bytes:
    """What a built-in scene looks like once every sensor has measured.

    Raises:
        ProxError: there is no such scene.
    """
    trial = LiveTrial(load_scenario(name), "wb")
    for _ in range(round(_SEEN_AFTER / trial.period)):
        trial.step()
    return exported_scene(ArmMotion(SceneModel.of(trial.setup), [trial.moment()]))


def _together(runs: Sequence[ReplayedRun]) -> list[ArmMotion]:
    """The runs on the first one's times; one that ended earlier stays where it ended."""
    longest = max(runs, key=lambda run: run.moments[-1].elapsed)
    times = [moment.elapsed for moment in longest.moments]
    out = []
    for run in runs:
        own = np.array([moment.elapsed for moment in run.moments])
        rows = np.minimum(np.searchsorted(own, np.array(times) - 1e-6), len(own) - 1)
        moments = [
            replace(run.moments[int(row)], elapsed=time)
            for row, time in zip(rows, times, strict=True)
        ]
        out.append(ArmMotion(run.model, moments))
    return out

"""3D scenes of a report: recorded runs that play by themselves, and a scene that stands still."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import viser

from proxcgal.core.errors import ConfigError
from proxcgal.recording.reader import read_recording
from proxcgal.scenario.loading import load_scenario
from proxcgal.sim.moment import Moment
from proxcgal.trial.interactive import LiveTrial
from proxcgal.viewer.client_messages import ClientBounds
from proxcgal.viewer.drawing import Drawing, add_surroundings
from proxcgal.viewer.page_server import served_page
from proxcgal.viewer.replay_moments import ReplayedRun, replay_moments
from proxcgal.viewer.scene_model import SceneModel

_HZ = 10.0  # moments a second, where the run is short
_MOMENTS = 150  # at most
_SEEN_AFTER = 0.2  # [s] by then every sensor has measured


@dataclass(frozen=True, slots=True, eq=False)
class ArmMotion:
    """One arm's moments, in the order of their time."""

    model: SceneModel
    moments: Sequence[Moment]


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


def exported_scene(first: ArmMotion, ghosts: Sequence[ArmMotion] = ()) -> bytes:
    """The scene and how it moves, in real time.

    Args:
        first: drawn whole.
        ghosts: other arms in the same scene, see-through; their moments are as many, at the same
            times.

    Returns:
        What viser's client plays (zstd inside).
    """
    alone = ClientBounds(viewers=0)  # no page looks on
    with served_page("127.0.0.1", 0, label="", bounds=alone) as (server, _):
        add_surroundings(server, first.model)
        drawings = [Drawing(server.scene, first.model)]
        drawings += [
            Drawing(server.scene, ghost.model, name=f"/ghost{row}", ghost=True)
            for row, ghost in enumerate(ghosts)
        ]
        played = list(zip(*(each.moments for each in (first, *ghosts)), strict=True))
        for drawing, moment in zip(drawings, played[0], strict=True):
            drawing.show(moment)
        recorded = server.get_scene_serializer()
        for before, now in pairwise(played):
            recorded.insert_sleep(now[0].elapsed - before[0].elapsed)
            for drawing, moment in zip(drawings, now, strict=True):
                drawing.show(moment)
        return recorded.serialize()


def viser_client() -> str:
    """Viser's client: one HTML file that fetches nothing."""
    return (Path(viser.__file__).parent / "client" / "build" / "index.html").read_text()

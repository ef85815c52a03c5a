"""A recording as moments to draw: what was recorded, and what other settings make of its inputs."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from proxcgal.core.typing import Array
from proxcgal.recording.reader import Recording
from proxcgal.recording.replay import Replay
from proxcgal.scenario.setup import Setup
from proxcgal.sim.clouds import Clouds
from proxcgal.sim.moment import Moment
from proxcgal.sim.tick import Tick
from proxcgal.viewer.scene_model import SceneModel

AHEAD = 0.5  #: [s] that a recomputed command is followed for, to be seen


@dataclass(frozen=True, slots=True, eq=False)
class ReplayedRun:
    """A run's moments, evenly in time."""

    model: SceneModel
    controller: str
    moments: tuple[Moment, ...]
    same: int | None  #: ticks whose answers are the recorded ones bit for bit; None: as recorded
    ticks: int  #: of the recording
    clouds: bool = True  #: are they known?


def replay_moments(
    recording: Recording,
    hz: float,
    controller: str | None = None,
    overrides: Sequence[str] = (),
    *,
    ahead: bool = False,
) -> ReplayedRun:
    """The run as recorded; computed again for other settings, or where its clouds are missing.

    Args:
        recording: of a run; an older one that holds scan ticks only is shown without clouds.
        hz: moments a second, at most one a tick.
        controller: instead of the recorded one.
        overrides: `key.sub=value` on the recorded scenario.
        ahead: show the arm where its command would bring it within 0.5 s, not where it is.

    Raises:
        ConfigError: a bad override; what the recording does not hold.
    """
    settings, times = recording.settings, recording.elapsed()
    last, count = len(recording.ticks) - 1, len(recording.ticks)
    step = max(round(settings.scenario.simulation.control_hz / hz), 1)
    whole = settings.ticks == "all"
    if controller is None and not overrides and (recording.has_clouds or not whole):
        setup = Setup.of(settings.scenario)
        moments = [
            _moment(setup, recording.clouds(row), tick, q, float(times[row]))
            for row, (tick, q) in enumerate(zip(recording.ticks, recording.postures(), strict=True))
            if not whole or row % step == 0 or row == last
        ]
        model, known = SceneModel.of(setup), recording.has_clouds
        return ReplayedRun(model, settings.controller, tuple(moments), None, count, known)
    again = Replay(recording, controller, overrides)
    moments, same = [], 0
    both = zip(recording.ticks, again, recording.postures(), strict=True)
    for row, (then, now, q) in enumerate(both):
        same += now.result.same(then.result)
        if row % step == 0 or row == last:
            moments.append(_moment(again.setup, Clouds.of(again.ctrl), now, q, float(times[row])))
    if ahead:
        moments = [_ahead(again.setup, moment) for moment in moments]
    return ReplayedRun(SceneModel.of(again.setup), again.controller, tuple(moments), same, count)


def _moment(setup: Setup, clouds: Clouds | None, tick: Tick, q: Array, elapsed: float) -> Moment:
    true = tick.truth.distance
    return Moment.of(setup, tick.inputs, tick.result, clouds, elapsed, q=q, true=true)


def _ahead(setup: Setup, moment: Moment) -> Moment:
    q = np.clip(moment.q + AHEAD * moment.qd, setup.robot.q_min, setup.robot.q_max)
    return replace(moment, links_W=np.asarray(setup.robot.link_poses(q)))

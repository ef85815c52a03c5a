"""A recording as moments to draw: what was recorded, and what other settings make of its inputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from proxcgal.core.typing import Array
from proxcgal.recording.reader import Recording
from proxcgal.recording.replay import Replay
from proxcgal.scenario.setup import Setup
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
    same: int | None  #: ticks whose answers are the recorded ones bit for bit; None: not asked
    ticks: int  #: of the recording


def replay_moments(
    recording: Recording,
    hz: float,
    controller: str | None = None,
    overrides: Sequence[str] = (),
    *,
    ahead: bool = False,
) -> ReplayedRun:
    """Computes a recording again, which gives its clouds too.

    Args:
        recording: of a run; one that holds scan ticks only is shown as recorded, without clouds.
        hz: moments a second, at most one a tick.
        controller: instead of the recorded one.
        overrides: `key.sub=value` on the recorded scenario.
        ahead: show the arm where its command would bring it within 0.5 s, not where it is.

    Raises:
        ConfigError: a bad override; what the recording does not hold.
    """
    settings, times = recording.settings, recording.elapsed()
    if settings.ticks != "all" and controller is None and not overrides:
        setup = Setup.of(settings.scenario)
        rows = range(len(recording.ticks))
        moments = [
            _moment(setup, None, tick, q, float(time))
            for tick, q, time in zip(recording.ticks, recording.postures(), times, strict=True)
        ]
        return ReplayedRun(
            SceneModel.of(setup), settings.controller, tuple(moments), None, len(rows)
        )
    again = Replay(recording, controller, overrides)
    period = again.ctrl.config.period
    step = max(round(1.0 / (hz * period)), 1)
    last = len(recording.ticks) - 1
    moments, same = [], 0
    both = zip(recording.ticks, again, recording.postures(), strict=True)
    for row, (then, now, q) in enumerate(both):
        same += now.result.same(then.result)
        if row % step == 0 or row == last:
            moments.append(_moment(again.setup, again, now, q, float(times[row])))
    if ahead:
        moments = [_ahead(again.setup, moment) for moment in moments]
    return ReplayedRun(
        SceneModel.of(again.setup), again.controller, tuple(moments), same, len(recording.ticks)
    )


def _moment(setup: Setup, again: Replay | None, tick: Tick, q: Array, elapsed: float) -> Moment:
    ctrl = None if again is None else again.ctrl
    return Moment.of(setup, tick.inputs, tick.result, ctrl, elapsed, q=q, true=tick.truth.distance)


def _ahead(setup: Setup, moment: Moment) -> Moment:
    q = np.clip(moment.q + AHEAD * moment.qd, setup.robot.q_min, setup.robot.q_max)
    return replace(moment, links_W=np.asarray(setup.robot.link_poses(q)))

"""How often clouds come, over scripted ticks and stamps."""

from __future__ import annotations

from itertools import pairwise

import pytest
from proxcgal_ros.convert import SECOND
from proxcgal_ros.pacing import CloudPace, Pace

BEAT = 1.0 / 15.0  # [s] of the sensors
LAG = {"ring0": 0.0, "ring1": 0.004, "ring2": 0.011}  # [s] after the beat that each array tells


def clouds(hz: float, silent: str = "", seconds: float = 4.0) -> list[tuple[float, int]]:
    """When clouds come and what stamp [ns] they have, with a tick each 10 ms.

    Args:
        hz: of clouds, at most.
        silent: an array that tells nothing after the first second.
        seconds: of ticks.
    """
    pace, found = CloudPace(hz), []
    for row in range(round(100 * seconds)):
        time = 0.01 * row + 0.003
        stamps = {}
        for name, lag in LAG.items():
            until = min(time, 1.0) if name == silent else time
            if (beat := int((until - lag) / BEAT)) > 0:
                stamps[name] = round(beat * BEAT * SECOND)
        if pace.due_with(time, stamps):
            found.append((time, pace.newest_ns))
    return found


def test_a_cloud_comes_with_every_beat_of_the_sensors_once_all_arrays_have_told_it() -> None:
    found = clouds(hz=15.0)
    beats = [round(stamp / SECOND / BEAT) for _, stamp in found]
    assert beats[1:] == list(range(beats[1], beats[1] + len(beats) - 1))  # none twice, none missing
    assert len(found) >= 58
    for time, stamp in found[1:]:
        assert max(LAG.values()) <= time - stamp / SECOND <= max(LAG.values()) + 0.0101


def test_an_array_that_falls_silent_does_not_keep_the_others_waiting() -> None:
    found = clouds(hz=15.0, silent="ring2")
    gaps = [now[0] - before[0] for before, now in pairwise(found)]
    assert max(gaps) < 2.0 * BEAT
    assert found[-1][0] > 3.9


@pytest.mark.parametrize("hz", [1.0, 5.0, 13.0])
def test_no_more_clouds_come_than_are_wanted(hz: float) -> None:
    assert 3.0 * hz <= len(clouds(hz)) <= 4.0 * hz + 1.0


def test_a_turn_is_taken_once() -> None:
    pace = Pace(10.0)
    assert pace.due(5.0)
    assert not pace.due(5.05)
    assert pace.due(5.09)
    pace.set(100.0)
    assert pace.due(5.10)

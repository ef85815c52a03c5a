"""Counters of sensors that begin anew, and those that only seem to."""

from __future__ import annotations

from proxcgal_ros.restarts import Restarts

HOLD = 0.19
BEAT = 1.0 / 15.0


def told(counters: list[int], gap: float = 0.0, at: int = 10) -> list[int]:
    """What is passed on; before the one at `at` nothing came for `gap` [s]."""
    restarts = Restarts(HOLD)
    times = [i * BEAT + (gap if i >= at else 0.0) for i in range(len(counters))]
    return [
        restarts.counter(0, counter, time, time + 0.01)
        for counter, time in zip(counters, times, strict=True)
    ]


def test_counters_that_advance_are_left_alone() -> None:
    counters = [*range(2**32 - 5, 2**32), *range(5)]
    assert told(counters) == counters
    assert told([*range(10), *range(20, 30)], gap=1.0) == [*range(10), *range(20, 30)]


def test_after_a_silence_a_sensor_that_begins_anew_goes_on_from_its_second_packet() -> None:
    assert told([*range(50, 60), 0, 1, 2, 3], gap=0.5) == [*range(50, 60), 0, 60, 61, 62]


def test_without_a_silence_an_overtaken_packet_stays_old() -> None:
    assert told([*range(50, 60), 7, 8, 60]) == [*range(50, 60), 7, 8, 60]


def test_a_frozen_counter_is_never_taken_for_a_new_beginning() -> None:
    assert told([*range(50, 60), *[59] * 20], gap=0.5) == [*range(50, 60), *[59] * 20]
    assert told([*range(50, 60), *[3] * 20], gap=0.5) == [*range(50, 60), *[3] * 20]


def test_old_stamps_begin_nothing() -> None:
    restarts = Restarts(HOLD)
    for counter in range(50, 60):
        restarts.counter(0, counter, counter * BEAT, counter * BEAT)
    for counter in range(5):  # a late copy of old packets
        assert restarts.counter(0, counter, counter * BEAT, 100.0 + counter * BEAT) == counter

"""What the static campaign says of memory: shares, and why a draw came nearer with it."""

from typing import Any

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from proxcgal.study.bootstrap import ratio_interval
from proxcgal.study.static.memory_share import memory_sentences, memory_summary

KINDS = ("in_view", "remembered", "forgotten", "never_seen")


def trial(draw: int, controller: str, distance: float, kind: str | None = None) -> dict[str, Any]:
    row: dict[str, Any] = {
        "draw": draw, "controller": controller, "error": None, "held_ticks": 0,
        "goal_error_m": 0.3,
    }  # fmt: skip
    for moment in ("true_min", "true_final"):
        row |= {
            f"{moment}_m": distance, f"{moment}_s": 5.25, f"{moment}_link": "wrist_2_link",
            f"seen_at_{moment}_m": 0.274, f"believed_at_{moment}_link": "forearm_link",
            f"sighting_at_{moment}": kind,
            f"sighting_age_at_{moment}_s": None if kind in (None, "never_seen") else 3.5,
        }  # fmt: skip
    return row


def draw(number: int, wb: float, memory: float, kind: str) -> list[dict[str, Any]]:
    return [
        trial(number, "wb", wb, "in_view"),
        trial(number, "wb_memory", memory, kind),
        trial(number, "wb_known", 0.25),
    ]


@settings(deadline=None, max_examples=15)
@given(
    st.lists(
        st.tuples(st.floats(0.0, 0.3), st.floats(0.0, 0.3), st.sampled_from(KINDS)),
        min_size=1, max_size=6,
    )
)  # fmt: skip
def test_every_draw_worse_by_more_than_20_mm_is_listed_with_its_reason(
    cases: list[tuple[float, float, str]],
) -> None:
    rows = [row for number, case in enumerate(cases) for row in draw(number, *case)]
    found = memory_summary(pl.DataFrame(rows, infer_schema_length=None))
    assert found is not None
    worse = [n for n, (wb, memory, _) in enumerate(cases) if 1000.0 * (memory - wb) < -20.0]
    for measure in ("true_min_m", "true_final_m"):
        listed = found[measure]["worse"]
        assert [case["draw"] for case in listed] == worse
        assert all("forearm_link" in case["reason"] for case in listed)
    told = [line for line in memory_sentences("side", found) if line.startswith("side, draw")]
    assert len(told) == 2 * len(worse)


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("in_view", "was in view"),
        ("remembered", "3.50 s before, so within the memory's time"),
        ("forgotten", "3.50 s before, longer than the memory's time"),
        ("never_seen", "no scan had had in view"),
    ],
)
def test_the_reason_says_what_was_known_of_the_closest_point(kind: str, words: str) -> None:
    rows = draw(7, 0.2, 0.0, kind)
    rows[1]["goal_error_m"] = 0.7
    found = memory_summary(pl.DataFrame(rows, infer_schema_length=None))
    assert found is not None
    reason = found["true_min_m"]["worse"][0]["reason"]
    assert reason.startswith("another way: ends 0.700 m from the goal, against 0.300 m; with it, ")
    assert "at 5.2 s wrist_2_link is nearest" in reason
    assert words in reason
    assert "the nearest believed was 0.274 m off at forearm_link" in reason


def test_the_share_closed_and_its_interval_are_those_of_scipy() -> None:
    generator = np.random.default_rng(3)
    lost = generator.normal(30.0, 20.0, 60)
    regained = 0.4 * lost + generator.normal(0.0, 5.0, 60)
    found = ratio_interval(regained, lost)
    assert found.middle == pytest.approx(regained.sum() / lost.sum())
    oracle = stats.bootstrap(
        (regained, lost), lambda up, down, axis: up.sum(axis=axis) / down.sum(axis=axis),
        method="percentile", paired=True, n_resamples=10_000, rng=1,
    ).confidence_interval  # fmt: skip
    assert found.low == pytest.approx(oracle.low, abs=0.01)
    assert found.high == pytest.approx(oracle.high, abs=0.01)


def told_of(cases: list[tuple[float, float]]) -> str:
    """Of draws with these ends of wb and wb_memory; wb_known ends at 0.25 m."""
    rows = [row for n, case in enumerate(cases) for row in draw(n, *case, "in_view")]
    table = pl.DataFrame(rows, infer_schema_length=None)
    return next(memory_sentences("side", memory_summary(table)))


def test_few_draws_are_said_to_be_few() -> None:
    assert told_of([(0.20, 0.20), (0.15, 0.15)]) == (
        "side: at the end memory closes 0 % of what sensing costs (too few draws to say how sure "
        "that is; +0.0 of +75.0 mm in the mean of 2 draws)."
    )
    assert "(95 % interval 0 to 0 %; " in told_of([(0.20, 0.1999999)] * 6)


def test_a_cost_that_may_be_none_is_told_from_no_cost() -> None:
    unsure = told_of([(0.10, 0.10), *[(0.27, 0.27)] * 6])
    assert unsure == (
        "side: at the end sensing costs 4.3 mm in the mean, over the draws too unsure to tell from "
        "nothing: no share to close."
    )
    assert told_of([(0.27, 0.27)] * 6) == (
        "side: at the end sensing costs nothing in the mean: no share to close."
    )

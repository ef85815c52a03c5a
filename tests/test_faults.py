"""Faults in running trials: the rows of the campaign, and a few of them run."""

import pytest

from proxcgal.sim.scenario import load_scenario
from proxcgal.study.campaign import Trial
from proxcgal.study.fault_rows import DEGRADED, HOLD, ROWS, RUN
from proxcgal.study.faults import KIND, perform, plan
from proxcgal.study.kind import Wishes

SHOWN = (
    "sensor silent", "array silent", "range nan", "same payload", "clock an hour back",
    "joint state 50 ms old", "deadlines missed",
)  # fmt: skip


@pytest.fixture(scope="module")
def trials() -> dict[str, Trial]:
    campaign = plan(Wishes(runs=1, seed=0, scenarios=("timing_ur10e",)))
    return {str(trial.tags["row"]): trial for trial in campaign.trials}


def test_every_row_is_planned_once_a_run(trials: dict[str, Trial]) -> None:
    assert list(trials) == [row.name for row in ROWS]
    assert len({trial.key for trial in trials.values()}) == len(ROWS)


def test_bounds_are_those_of_the_table() -> None:
    for row in ROWS:
        assert RUN <= row.least <= row.most
        if row.least == DEGRADED and row.name != "same payload":
            assert row.within == 0.15
        if "silent" in row.name and row.least == HOLD:
            assert row.within == 0.2


def test_what_a_user_types_repeats_a_trial(trials: dict[str, Trial]) -> None:
    trial = trials["sensor silent"]
    assert load_scenario(trial.source, trial.overrides) == trial.scenario
    assert trial.scenario.faults


@pytest.mark.parametrize("name", SHOWN)
def test_the_mode_is_right_in_time_and_the_arm_recovers(
    trials: dict[str, Trial], name: str
) -> None:
    numbers = perform(trials[name], lambda _: None)
    assert numbers["right"], numbers


@pytest.mark.long
@pytest.mark.parametrize("name", [row.name for row in ROWS if row.name not in SHOWN])
def test_the_other_rows_too(trials: dict[str, Trial], name: str) -> None:
    numbers = perform(trials[name], lambda _: None)
    assert numbers["right"], numbers


def test_the_campaign_lists_wrong_rows_by_name() -> None:
    summary = {
        "right": 1,
        "robots": {"ur10e": {"all silent": {
            "runs": 2, "right": 1, "latency_median_ms": 150.0, "latency_max_ms": 250.0,
            "worst_modes": {"HOLD": 2},
        }}},
    }  # fmt: skip
    assert KIND.verdicts(summary) == [
        "The behaviour was right in 1 of 2 runs.",
        "Not always right: all silent on ur10e (1 of 2).",
    ]
    (listing,) = KIND.listings(summary)
    assert "250" in str(listing)

"""Faults in running trials: the rows of the campaign, and a few of them run."""

import re
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import proxcgal as px
from proxcgal import _core
from proxcgal.core.errors import ConfigError
from proxcgal.core.modes import DEGRADED, HOLD, RUN, STOP
from proxcgal.recording.reader import read_recording
from proxcgal.recording.render import recorded_moments
from proxcgal.recording.writer import Recorder
from proxcgal.scenario.fault_keys import INPUT_FAULTS, Fault
from proxcgal.scenario.loading import load_scenario
from proxcgal.sim.faults import FaultInjector
from proxcgal.sim.tick import TickInput
from proxcgal.study.campaign import CampaignRequest, Trial
from proxcgal.study.faults.campaign import KIND, perform, plan
from proxcgal.study.faults.cases import ROWS
from proxcgal.study.faults.reliability_page import GOALS, reliability_page
from proxcgal.study.faults.reliability_page import SHOWN as SHOWN_BY_TESTS
from proxcgal.trial.trial import run_trial

SHOWN = (
    "sensor silent", "array silent", "range nan", "same payload", "scans out of order",
    "all stamps 30 ms late, fast", "all stamps 30 ms early, fast", "clock an hour back",
    "joint state 50 ms old", "joint state not a number", "deadlines missed", "mount 5 mm off",
    "mount 2 degrees off",
)  # fmt: skip


@pytest.fixture(scope="module")
def trials() -> dict[str, Trial]:
    campaign = plan(CampaignRequest(runs=1, seed=0, scenarios=("timing_ur10e",)))
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
    assert list(KIND.verdicts(summary)) == [
        "The behaviour was right in 1 of 2 runs.",
        "Not always right: all silent on ur10e (1 of 2).",
    ]
    (listing,) = KIND.listings(summary)
    assert "250" in str(listing)


def test_every_status_code_is_judged_as_the_table_has_it() -> None:
    model = px.SensorModel()
    for code in range(256):
        scan = px.Scan(0, 0, 0.0, np.full(64, 0.5), np.full(64, code, np.uint8))
        zones, _, _, sigmas = _core.sense(model, scan)
        assert len(zones) == (64 if code in (5, 6, 9) else 0), code
        if code in (6, 9):
            sure = px.Scan(0, 0, 0.0, np.full(64, 0.5), np.full(64, 5, np.uint8))
            assert (sigmas > _core.sense(model, sure)[3]).all()


def through(kind: str, ticks: int) -> list[TickInput]:
    of = {} if kind in INPUT_FAULTS else {"sensor": 0}
    fault = Fault.model_validate({"kind": kind, "from": 0.0, **of})
    inject = FaultInjector([fault], ["a", "b"], seed=0)
    ranges, status = np.full(64, 0.5), np.full(64, 5, np.uint8)
    return [
        inject(
            TickInput(
                0.1 * n, np.zeros(6), np.eye(4),
                tuple(px.Scan(row, n, 0.1 * n, ranges, status) for row in range(2)),
            )
        )
        for n in range(ticks)
    ]  # fmt: skip


def test_swapped_scans_come_in_pairs_the_later_first() -> None:
    inputs = through("swapped", 6)
    assert [s.counter for g in inputs for s in g.scans if s.sensor == 0] == [1, 0, 3, 2, 5, 4]
    assert [s.counter for g in inputs for s in g.scans if s.sensor == 1] == list(range(6))


def test_a_joint_state_that_is_not_a_number_is_all_of_it() -> None:
    assert all(np.isnan(inputs.q).all() for inputs in through("joints_nan", 3))


def test_a_run_whose_joint_state_is_never_a_number_is_recorded_to_its_end(tmp_path: Path) -> None:
    overrides = ('fault=[{kind = "joints_nan"}]', "duration=0.1", "vertices_per_link=500")
    scenario = load_scenario("front_plane", overrides)
    with Recorder(tmp_path / "nan.mcap") as recorder:
        log = run_trial(scenario, "wb", recorder=recorder)
    assert (log.mode == STOP).all()
    assert log.recording_failure is None
    drawn = recorded_moments(read_recording(tmp_path / "nan.mcap"), [0.0, 0.05])
    assert all((moment.q == scenario.q0).all() for moment in drawn)


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        ('kind = "dropout", value = 1.5', "value = 1.5, share of zones lost, 0 to 1: must be from"),
        ('kind = "mount_turn", value = 1e300', "must be from -3.14159 to 3.14159"),
        (
            'kind = "delay", value = -0.1',
            "value = -0.1, scans arrive this much later [s]: must be from",
        ),
        ('kind = "status", value = 4.5', "status code, 0 to 255: must be whole"),
        (
            'kind = "joints_nan", sensor = 3',
            "joints_nan concerns no sensor: sensor is to be left out",
        ),
    ],
)
def test_a_fault_that_makes_no_sense_is_told_with_what_is_allowed(fault: str, told: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_scenario("front_plane", (f"fault=[{{{fault}}}]",))
    assert told in str(caught.value)


ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "reliability.md"


def test_the_page_has_the_campaigns_rows_and_no_other() -> None:
    text = PAGE.read_text()
    part = text[text.index("| fault |") : text.index("## Shown by tests")]
    told = dict.fromkeys(line.split(" | ")[0][2:] for line in part.splitlines()[2:] if "|" in line)
    assert list(told) == [row.name for row in ROWS]
    for shown in SHOWN_BY_TESTS:
        assert f"| {shown.fault} | {shown.required} |" in text
    for goal in GOALS:
        assert f"| {goal.goal} |" in text


def test_every_test_that_the_page_names_exists() -> None:
    for file, name in {test for entry in (*SHOWN_BY_TESTS, *GOALS) for test in entry.tests}:
        assert re.search(rf"\b{re.escape(name)}\b", (ROOT / file).read_text()), f"{file} {name}"


def test_a_page_of_few_runs_claims_no_goal_and_has_no_link_that_leads_nowhere() -> None:
    summary = {"robots": {}, "right": 0, "runs": 1}
    assert "## Goals" not in reliability_page(ROWS, summary, {})
    assert "## Goals" in reliability_page(ROWS, summary | {"runs": 200}, {})
    assert "](" not in reliability_page(ROWS, summary | {"runs": 200}, {})


def test_a_scenario_of_another_kind_is_refused_by_its_kind() -> None:
    with pytest.raises(ConfigError, match=r'--scenario hri_task1: kind = "hri": .*"static"'):
        plan(CampaignRequest(runs=1, seed=0, scenarios=("hri_task1",)))


def test_a_run_too_short_to_show_that_the_arm_recovers_is_refused() -> None:
    wishes = CampaignRequest(
        runs=1, seed=0, scenarios=("timing_ur10e",), overrides=("duration=1.0",)
    )
    with pytest.raises(ConfigError, match=r"--set duration=1: must be more than 1\.9 s"):
        plan(wishes)


def test_every_latency_is_drawn_and_no_figure_of_none() -> None:
    table = pl.DataFrame(
        {"robot": ["ur10e"] * 2, "row": ["all silent"] * 2, "error": [None, None],
         "latency_ms": [150.0, 205.0]},
        schema_overrides={"error": pl.String},
    )  # fmt: skip
    (axes,) = KIND.figures(table)["latency.png"].axes
    dots = [x for line in axes.lines if line.get_marker() == "." for x in line.get_xdata()]
    assert dots == [150.0, 205.0]
    assert KIND.figures(table.with_columns(error=pl.lit("broken"))) == {}

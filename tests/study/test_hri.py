"""The human study: way points, moved cells, and the paper's tables out of trials."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from proxcgal.core.errors import ConfigError
from proxcgal.evaluation.trial_log import sampled_ticks
from proxcgal.scenario.hri_scenario import HriScenario
from proxcgal.scenario.loading import load_scenario
from proxcgal.scene.human.motion import move
from proxcgal.scene.human.recorded import write_motion
from proxcgal.scene.human.subject import draw_subject
from proxcgal.sim.waypoints import Waypoints
from proxcgal.study.campaign import CampaignRequest
from proxcgal.study.hri import campaign as hri_campaign
from proxcgal.study.hri.figures import figures
from proxcgal.study.hri.layouts import JITTER_M, draw_layout
from proxcgal.study.hri.metrics import PAPER_MEANS, analyse, held
from proxcgal.study.hri.paper_tables import listings
from proxcgal.study.hri.texts import captions, introduction, verdicts
from proxcgal.study.hri.trial_metrics import COLUMNS, trial_metrics
from proxcgal.study.trial_simulation import robot_of
from proxcgal.trial.trial import run_trial

#: The study in short: half a second, the first signal alone.
STEP = '{at=0.0, mark="P1", reach="T1", within=9.5, phase="T1"}'
SHORT = ("duration=0.5", f"operator.timeline=[{STEP}]")


def goal_at(x: float) -> np.ndarray:
    T_WT = np.eye(4)
    T_WT[0, 3] = x
    return T_WT


def test_way_points_go_back_and_forth_on_arrival() -> None:
    waypoints = Waypoints([goal_at(0.0), goal_at(1.0), goal_at(2.0)], arrival=0.02, patience=100.0)
    visited = []
    tool_W = np.array([5.0, 0.0, 0.0])
    for tick in range(7):
        goal = waypoints.at(float(tick), tool_W)
        visited.append(goal[0, 3])
        tool_W = goal[:3, 3]  # there at once
    assert visited == [0.0, 1.0, 2.0, 1.0, 0.0, 1.0, 2.0]


def test_a_way_point_out_of_reach_is_given_up_when_patience_runs_out() -> None:
    waypoints = Waypoints([goal_at(0.0), goal_at(1.0)], arrival=0.02, patience=10.0)
    far = np.array([9.0, 0.0, 0.0])
    times = [0.0, 9.99, 10.0, 19.99, 20.0]
    assert [waypoints.at(time, far)[0, 3] for time in times] == [0.0, 0.0, 1.0, 1.0, 0.0]


def test_one_goal_stays_whatever_happens() -> None:
    waypoints = Waypoints([goal_at(1.0)], arrival=0.02, patience=1.0)
    assert waypoints.at(50.0, np.array([1.0, 0.0, 0.0]))[0, 3] == 1.0


def test_samples_are_the_first_ticks_of_their_periods() -> None:
    elapsed = np.arange(100) * 0.01
    rows = np.flatnonzero(sampled_ticks(elapsed, 15.0))
    np.testing.assert_array_equal(rows, np.ceil(np.arange(15) * 100 / 15 - 1e-9))
    assert not sampled_ticks(elapsed, 0.0).any()


@pytest.fixture(scope="module")
def task1() -> HriScenario:
    scenario = load_scenario("hri_task1", ["operator.subject=3"])
    assert isinstance(scenario, HriScenario)
    return scenario


def test_the_cell_stands_where_the_experiment_puts_it(task1: HriScenario) -> None:
    robot = robot_of(task1)
    assert task1.goal.waypoints == ((0.95, 0.30, 0.25), (0.95, -0.30, 0.25))
    tool = robot.tool_pose(np.array(task1.q0))
    np.testing.assert_allclose(tool[:3, 3], [0.95, 0.30, 0.25], atol=1e-3)
    np.testing.assert_allclose(tool[:3, 2], [1.0, 0.0, 0.0], atol=1e-3)  # towards the door
    door = task1.obstacles[0]
    assert door.position[0] - 0.5 * door.size[0] == pytest.approx(1.2)
    assert not door.sensed
    assert task1.windows() == {"H1": (10.0, 25.0), "H2": (35.0, 50.0)}
    task2 = load_scenario("hri_task2")
    assert isinstance(task2, HriScenario)
    assert task2.operator.places == {"T2": (0.10, -0.75, 0.0), "H3": (1.15, -0.50, 0.20)}
    assert task2.windows() == {"H3_first": (10.0, 25.0), "H3_second": (35.0, 50.0)}


def test_the_door_is_sensed_only_where_the_scenario_says_so(task1: HriScenario) -> None:
    assert "door" not in task1.scene().names
    assert "door" in task1.drawn().names
    sensed = load_scenario("hri_task1", ["obstacle.0.sensed=true"])
    assert "door" in sensed.scene().names
    assert "door" not in sensed.measured().names  # distances run from the human


def test_moved_cells_are_moved_by_a_decimetre_at_most_and_always_alike(task1: HriScenario) -> None:
    own = ("operator.subject=3",)
    one, same, other = (draw_layout(task1, own, seed, 3, jitter=True) for seed in (0, 0, 1))
    assert one.scenario == same.scenario
    assert one.scenario != other.scenario
    places, before = one.scenario.operator.places, task1.operator.places
    shifts = np.array([np.subtract(places[name], before[name]) for name in before])
    assert np.abs(shifts).max() <= JITTER_M + 1e-4
    assert (shifts != 0.0).all()
    assert one.scenario.goal.waypoints != task1.goal.waypoints
    assert one.scenario.obstacles == task1.obstacles  # what is only drawn stays
    assert draw_layout(task1, own, 0, 3, jitter=False).scenario == task1
    again = load_scenario("hri_task1", one.overrides)
    assert again == one.scenario


def table_of(values: dict[str, dict[int, float]], phase: float = 0.25) -> pl.DataFrame:
    """A task's trials: by controller and subject, the mean distance; the courses rise by it."""
    rows = []
    for layout in ("main", "jittered"):
        for controller, means in values.items():
            for subject, mean in means.items():
                course = [mean, mean + 0.1 * subject, mean]
                rows.append(
                    {
                        "key": f"{layout}{controller}{subject}", "task": "task2",
                        "layout": layout, "subject": subject, "controller": controller,
                        "error": None, "mean_m": mean, "seen_mean_m": mean + 0.01,
                        "empty_ticks": 5, "ticks": 100, "true_min_m": mean / 2,
                        "true_min_link": "wrist_1_link",
                        "too_close_ticks": 3 if controller == "sm" else 0,
                        "blind_ticks": 2 if controller == "sm" else 0, "self_min_m": 0.1,
                        "leaked_points_max": 0, "held_ticks": 0, "finite": True,
                        "limits_kept": True,
                        "phase_means": json.dumps({"H3_first": [mean + phase, None]}),
                        "windows": json.dumps({"H3_first": [0.05, 0.1]}),
                        "signals": json.dumps([[0.0, "enters"]]), "d_min_m": 0.2,
                        "buffer_m": 0.1, "true_m": course, "seen_m": [None, *course[1:]],
                        "activation": [0.0, 1.0, 0.5], "wall_s": 1.5,
                    }
                )  # fmt: skip
    return pl.DataFrame(rows, schema_overrides={"error": pl.String})


@pytest.fixture
def campaign() -> Any:
    return hri_campaign.plan(CampaignRequest(runs=1, seed=0, jitter=False, controllers=("wb",)))


MEANS = {"wb": {1: 0.30, 2: 0.34, 3: 0.38}, "sm": {1: 0.28, 2: 0.33, 3: 0.36}}


def test_the_tables_are_those_of_the_trials(campaign: Any) -> None:
    summary = analyse(table_of(MEANS), campaign)
    cell = summary["table1"]["task2"]["wb"]
    assert cell["mean_m"] == pytest.approx(0.34)
    assert cell["seen_mean_m"] == pytest.approx(0.35)
    # Over the subjects at the second moment: 0.40, 0.54, 0.68.
    assert cell["sigma_max_m"] == pytest.approx(np.std([0.40, 0.54, 0.68], ddof=1))
    phase = summary["table2"]["H3_first"]["sm"]
    assert phase["mean_m"] == pytest.approx(np.mean([0.28, 0.33, 0.36]) + 0.25)
    assert phase["seen_mean_m"] is None
    # Of its window, 0.05 to 0.1 s: the second moment alone.
    assert phase["sigma_max_m"] == pytest.approx(np.std([0.38, 0.53, 0.66], ddof=1))
    pair = summary["paired_mm"]["task2"]["wb-sm"]
    assert pair["mean"] == pytest.approx(np.mean([20.0, 10.0, 20.0]))
    assert 9.9 < pair["low"] <= pair["mean"] <= pair["high"] < 20.1
    least = summary["paired_least_mm"]["task2"]["wb-sm"]
    assert least["mean"] == pytest.approx(np.mean([10.0, 5.0, 10.0]))
    assert summary["too_close"] == {"wb": 0, "sm": 9, "of_which_blind": 6}
    assert summary["jittered"]["table1"] == summary["table1"]
    assert summary["wall_s"] == pytest.approx(1.5 * 12)


#: Twice as many subjects: enough for a verdict.
SIX = {
    name: means | {subject + 3: mean for subject, mean in means.items()}
    for name, means in MEANS.items()
}


def test_bounds_hold_or_do_not_as_the_numbers_say(campaign: Any) -> None:
    good = analyse(table_of(MEANS), campaign)
    assert all(holds for _, holds, _ in held(good))
    turned = analyse(table_of({"wb": MEANS["sm"], "sm": MEANS["wb"]}), campaign)
    failed = {what for what, holds, _ in held(turned) if not holds}
    assert "task2: wb >= sm" in failed
    assert "H3_first: interval above -5 mm" in failed
    assert not any("HOLD" in sentence for sentence in verdicts(turned))  # of three subjects
    six = analyse(table_of({"wb": SIX["sm"], "sm": SIX["wb"]}), campaign)
    assert any("DOES NOT HOLD" in sentence for sentence in verdicts(six))


def test_every_row_has_its_sentence_with_a_bound_or_without(campaign: Any) -> None:
    summary = analyse(table_of(SIX), campaign)
    told = [text for text in verdicts(summary) if text.startswith("main: ")]
    assert any("Assembly Task 2, mean true distance: wb is farther off" in text for text in told)
    assert any("Task 2, least true distance: wb is farther off" in text for text in told)
    few = list(verdicts(analyse(table_of(MEANS), campaign)))
    assert any("3 pairs, too few to tell wb and sm apart" in text for text in few)


@pytest.mark.parametrize(
    ("changed", "rows"),
    [
        ((), ["task1", "H1", "H2"]),
        (("controller.d_min=0.25", "simulation.dropout=0.1"), ["task1", "H1", "H2"]),
        (("operator.places.H1=[1.0, 0.45, 0.3]",), []),
        (("duration=60.0",), []),
    ],
)
def test_only_the_papers_own_cell_is_compared_with_the_paper(
    changed: tuple[str, ...], rows: list[str], tmp_path: Path
) -> None:
    path = tmp_path / "hri_task1.toml"
    path.write_text(load_scenario("hri_task1", changed).to_toml())
    wishes = CampaignRequest(
        runs=1, seed=0, jitter=False, scenarios=(str(path),), controllers=("wb",)
    )
    assert hri_campaign.plan(wishes).notes["compared"] == rows


def test_rows_of_another_cell_have_no_figures_of_the_paper(campaign: Any) -> None:
    table = table_of(MEANS)
    summary = analyse(table, campaign) | {"compared": []}
    (first,) = [each for each in listings(summary) if each.caption.startswith("Table I,")][:1]
    assert {(row[4], row[5], row[6]) for row in first.rows} == {("-", "-", "-")}
    assert not any("paper's +" in text or "wb >= sm" in text for text in verdicts(summary))
    assert "No row is compared with the paper" in introduction(summary)
    assert not any("paper" in text for name, text in captions(summary).items()
                   if name != "trials.png")  # fmt: skip
    drawn = figures(table, summary)
    for name in ("subjects.png", "differences.png"):
        assert not [line for line in drawn[name].axes[0].lines if line.get_marker() == "x"]


def test_the_introduction_tells_what_ran(campaign: Any) -> None:
    table = table_of(MEANS)
    both = introduction(analyse(table, campaign))
    assert "moved at random" in both
    assert "wb_known" not in both
    main = analyse(table.filter(pl.col("layout") == "main"), campaign)
    assert "moved" not in introduction(main)
    assert "moved" not in captions(main)["differences.png"]


def test_the_same_phase_in_two_scenes_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "other.toml"
    path.write_text(load_scenario("hri_task1", ['name="hri_other"']).to_toml())
    wishes = CampaignRequest(runs=1, seed=0, jitter=False, scenarios=("hri_task1", str(path)))
    with pytest.raises(ConfigError, match=r"other\.toml: phase H1.* hri_task1"):
        hri_campaign.plan(wishes)


def test_a_recording_is_no_subject_that_is_drawn(tmp_path: Path) -> None:
    path = tmp_path / "walk.csv"
    operator = load_scenario("hri_task1").operator  # type: ignore[attr-defined]
    write_motion(move(draw_subject(1), operator, 65.0), path)
    recording = (f'operator.recording="{path}"',)
    alone = CampaignRequest(runs=1, seed=0, jitter=False, overrides=recording)
    assert len(hri_campaign.plan(alone).trials) == 2 * 4
    for several in (
        CampaignRequest(runs=2, seed=0, jitter=False, overrides=recording),
        CampaignRequest(runs=1, seed=0, overrides=recording),
    ):
        with pytest.raises(ConfigError, match=r"operator\.recording .* --subjects 1 --no-jitter"):
            hri_campaign.plan(several)


def test_a_recorded_person_is_told_and_no_subject(call: Callable[..., Any], tmp_path: Path) -> None:
    path = tmp_path / "walk.csv"
    operator = load_scenario("hri_task1").operator  # type: ignore[attr-defined]
    write_motion(move(draw_subject(1), operator, 1.0), path)
    words = (
        "run", "hri_task1", "--controller", "wb", "--no-picture", "--quiet", "--workers", "1",
        "--out", str(tmp_path / "out"), "--set", "duration=0.5", f'operator.recording="{path}"',
    )  # fmt: skip
    assert call(*words).code == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert (summary["subject"], summary["recording"]) == (None, "walk.csv")
    page = (tmp_path / "out" / "report.html").read_text()
    assert "The person recorded in walk.csv" in page
    assert "virtual subject" not in page
    refused = call(*words, "--subject", "3")
    assert refused.code == 2
    assert "--subject 3: operator.recording" in refused.err
    played = load_scenario("hri_task1", [f'operator.recording="{path}"'])
    assert isinstance(played, HriScenario)
    assert played.signals() == []  # nobody follows them


def test_the_papers_figures_stand_beside_ours(campaign: Any) -> None:
    text = "\n".join(map(str, listings(analyse(table_of(MEANS), campaign))))
    for row, cell in (
        ("Assembly Task 2", PAPER_MEANS["task2"]),
        ("first run", PAPER_MEANS["H3_first"]),
    ):
        lines = [line for line in text.splitlines() if row in line]
        assert any(f"{cell['wb'][0]:.3f}" in line for line in lines)
    assert "d_min [m]" in text
    assert "\n\n" not in text  # a table without units has no row for them


def test_the_papers_means_stand_beside_seen_ones_of_ours() -> None:
    table = table_of(MEANS).filter(pl.col("layout") == "main")
    axes = figures(table)["subjects.png"].axes[0]
    diamonds = [line.get_ydata()[0] for line in axes.lines if line.get_marker() == "D"]
    assert diamonds == pytest.approx([0.35, np.mean([0.28, 0.33, 0.36]) + 0.01])  # none in H3_first


def test_whole_body_and_sensor_points_lie_over_the_others() -> None:
    means = {name: MEANS["wb"] for name in ("wb", "sm", "wb_known", "wb_memory")}
    table = table_of(means).filter(pl.col("layout") == "main")
    axes = figures(table)["cycles.png"].axes[0]
    over = [line.get_zorder() for line in axes.lines[:4]]
    assert min(over[:2]) > max(over[2:])


def test_every_figure_has_a_caption(campaign: Any) -> None:
    table = table_of(MEANS)
    assert {*figures(table), "motion.gif"} == set(captions(analyse(table, campaign)))
    assert figures(table.with_columns(error=pl.lit("broken"))) == {}


def test_a_trial_beside_a_person_keeps_the_robots_limits() -> None:
    scenario = load_scenario("hri_task1", ("operator.subject=2", *SHORT))
    assert isinstance(scenario, HriScenario)
    log = run_trial(scenario, "wb", sparse_truth=True, truth_hz=15.0)
    numbers = trial_metrics(log, scenario)
    assert numbers["finite"]
    assert numbers["limits_kept"]
    assert set(numbers) == set(COLUMNS)
    every = run_trial(scenario, "wb")
    samples = sampled_ticks(every.elapsed, 15.0)
    np.testing.assert_allclose(log.true_m[samples], every.true_m[samples], atol=1e-9)
    assert numbers["mean_m"] == pytest.approx(every.true_m[samples].mean())


def test_the_campaign_is_the_same_on_one_worker_and_on_two(
    call: Callable[..., Any], tmp_path: Path
) -> None:
    found = []
    for workers in ("1", "2"):
        folder = tmp_path / workers
        answer = call(
            "campaign", "hri", "--scenario", "hri_task1", "--subjects", "1", "--controller", "wb",
            "sm", "--keep", "none", "--no-picture", "--quiet", "--workers", workers, "--out",
            str(folder),
            "--set", *SHORT,
        )  # fmt: skip
        assert answer.code == 0, answer.err
        summary = json.loads((folder / "summary.json").read_text())
        assert summary.pop("wall_s") > 0.0
        assert summary["subjects"] == 1
        assert summary["simulated_s"] == pytest.approx(4 * 0.5)
        assert set(summary["jittered"]["table1"]) == {"task1"}
        found.append(json.dumps(summary))
        assert "A human in the workspace" in (folder / "report.html").read_text()
    assert found[0] == found[1]


def test_a_run_beside_a_person_has_means_and_no_gain_at_its_end(
    call: Callable[..., Any], tmp_path: Path
) -> None:
    answer = call(
        "run", "hri_task1", "--subject", "99", "--controller", "wb", "sm", "--no-picture",
        "--quiet", "--workers", "1", "--out", str(tmp_path / "out"), "--set", *SHORT,
    )  # fmt: skip
    assert answer.code == 0, answer.err
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["subject"] == 99
    assert summary["gain_mm"] is None
    assert summary["controllers"]["wb"]["mean_m"]["cycle"]["true"] > 0.0


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("campaign", "static", "--subjects", "3"), "--subjects: goes with campaign hri"),
        (("campaign", "hri", "--subjects", "0"), "--subjects 0: must be 1 or more"),
        (("campaign", "hri", "--runs", "2", "--subjects", "2"), "say the same"),
        (("campaign", "hri", "--scenario", "front_plane"), 'must be "hri"'),
        (("campaign", "hri", "--set", "operator.subject=3"), "every subject has its own"),
        (("run", "front_plane", "--subject", "3"), "no operator"),
        (("run", "hri_task1", "--subject", "0"), "--subject 0: must be 1 to"),
    ],
)
def test_what_cannot_be_is_told(
    call: Callable[..., Any], words: tuple[str, ...], told: str
) -> None:
    answer = call(*words)
    assert answer.code == 2
    assert told in answer.err


def test_fig_9_shows_a_subject_that_both_controllers_met() -> None:
    table = table_of(MEANS)
    failed = table.with_columns(
        error=pl.when((pl.col("subject") == 1) & (pl.col("controller") == "wb"))
        .then(pl.lit("broken")).otherwise(None)
    )  # fmt: skip
    drawn = figures(failed)["trials.png"]
    assert drawn.get_suptitle() == "Task 2, subject 2"
    apart = table.filter((pl.col("controller") == "wb") == (pl.col("subject") == 1))
    assert figures(apart)["trials.png"].get_suptitle() == "Task 2, subject 2"  # sm's alone

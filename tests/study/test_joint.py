"""The study of the 12-joint robot: what is run, what is written, what is said of it."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from proxcgal.core.errors import ConfigError
from proxcgal.scenario.scenario import CONTROLLERS
from proxcgal.study.campaign import CampaignRequest
from proxcgal.study.joint.campaign import KIND, PERCEPTIONS, SCENES, STACKS
from proxcgal.study.joint.texts import listings, verdicts

KEYS = {
    "scenario", "init", "tasks", "succeeded", "time_s", "position_error_m", "angle_error_rad",
    "true_min_m", "min_altitude_m", "macro_share",
}  # fmt: skip
SHORT = ("duration=0.5", "simulation.control_hz=50.0")


def run(**changes: Any) -> dict[str, Any]:
    """One entry of a summary."""
    return {
        "scenario": "joint_cylinder", "init": "free", "tasks": ["avoidance", "reach"],
        "stack": "full", "perception": "known", "controller": "wb_known", "seed": 0,
        "succeeded": True, "outcome": "succeeded", "reason": "the goal is reached", "time_s": 9.0,
        "position_error_m": 0.03, "angle_error_rad": 0.01, "true_min_m": 0.07,
        "true_min_link": "ur10e_forearm_link", "seen_min_m": 0.07, "seen_at_true_min_m": 0.07,
        "min_altitude_m": 1.0, "limit_margin_rad": 0.06, "limit_joint": "kuka_joint_a3",
        "manipulability_macro": 0.1, "manipulability_micro": 0.2, "macro_share": 0.7,
        "way_m": 3.0, "self_min_m": 0.07, "held_ticks": 0, "holds_task": "", "holds_link": "",
        "holds_obstacle": "", "holds_sensor": -1, "holds_zone": -1, "tick_p99_us": 100.0,
    } | changes  # fmt: skip


def summary(*runs: dict[str, Any]) -> dict[str, Any]:
    return {"runs": list(runs), "self_under_limit": 0}


def test_every_scene_start_and_stack_is_run_known_and_every_seed_sensed() -> None:
    campaign = KIND.plan(CampaignRequest(runs=2, seed=3))
    names = [trial.name for trial in campaign.trials]
    assert len(set(names)) == len(names)
    sensed = [name for name, (controller, _) in PERCEPTIONS.items() if controller in CONTROLLERS]
    assert len(names) == len(SCENES) * 2 * (len(STACKS) + 2 * len(sensed))
    off = next(trial for trial in campaign.trials if trial.tags["stack"] == "no_avoidance")
    assert off.scenario.controller.levels == ("joint_limits", "minimum_altitude", "reach")
    assert '"avoidance"' in off.command
    second = next(t for t in campaign.trials if t.tags["perception"] == "sensed_2nd_set")
    assert second.scenario.skin.with_optional
    assert {t.seed for t in campaign.trials if t.controller == "wb"} == {3, 4}


def test_a_scene_of_another_kind_is_refused() -> None:
    with pytest.raises(ConfigError, match="kind = 'static'; needs 'joint'"):
        KIND.plan(CampaignRequest(runs=1, seed=0, scenarios=("front_plane",)))


@pytest.mark.parametrize("command", [("run", "joint_free"), ("campaign", "joint")])
def test_arms_that_there_are_not_are_refused_before_anything_runs(
    call: Callable[..., Any], command: tuple[str, ...]
) -> None:
    answer = call(*command, "--quiet", "--set", *SHORT, "controller.macro_joints=12")
    assert answer.code == 2
    assert "controller.macro_joints = 12: kr150_ur10e has 12 joints" in answer.err
    assert not list(Path().rglob("*.*"))  # nothing is written


def test_what_a_task_costs_and_buys_is_said_from_the_numbers() -> None:
    told = verdicts(summary(
        run(), run(init="jl", time_s=7.0, true_min_m=0.08),
        run(stack="no_avoidance", true_min_m=0.0, time_s=8.0),
        run(stack="no_avoidance", init="jl", true_min_m=0.0, time_s=6.5, succeeded=False),
    ))  # fmt: skip
    text = "\n".join(told)
    assert "full stack: 2 of 2 runs reach the goal, in 7.0 to 9.0 s" in text
    assert (
        "Without avoidance: 1 of 2 runs reach the goal (full: 2), -1.0 s in the median of those "
        "where both do; least true distance 0.000 m (full: 0.070)." in text
    )


def test_blind_spots_are_said_plainly() -> None:
    told = "\n".join(verdicts(summary(
        run(),
        run(perception="sensed", true_min_m=0.0, seen_at_true_min_m=0.4, succeeded=False,
            true_min_link="ur10e_wrist_2_link"),
        run(perception="sensed_2nd_set", true_min_m=0.02, seen_at_true_min_m=0.4),
    )))  # fmt: skip
    assert "1 come under 0.05 m of an obstacle (joint_cylinder from free), 1 of them unseen" in told
    assert "at the least 0.000 m, by ur10e_wrist_2_link" in told
    assert "second set of sensors on the KUKA's arm" in told
    assert "+20 mm in the median" in told


def test_every_column_of_numbers_has_a_name_of_its_own() -> None:
    for listing in listings(summary(run())):
        assert all(listing.names)
        assert len(set(listing.names)) == len(listing.names)


def test_a_trap_is_told_with_what_holds_it() -> None:
    held = run(succeeded=False, outcome="aborted", reason="held off by the obstacle (x, cylinder)",
               holds_task="avoidance")  # fmt: skip
    assert "joint_cylinder from free: aborted: held off by the obstacle (x, cylinder)." in verdicts(
        summary(held)
    )
    assert listings(summary(held))[0].rows[0][3] == "avoidance"


def test_another_stacks_run_is_told_in_sentences_too(call: Callable[..., Any]) -> None:
    answer = call("run", "joint_cylinder", "--set", *SHORT, 'controller.tasks=["thesis"]',
                  'initial=["jl"]', "--quiet", "--workers", "1")  # fmt: skip
    assert answer.code == 0, answer.err
    assert "Known obstacles, the thesis stack: 0 of 1 runs reach the goal." in answer.out


def test_run_writes_an_entry_for_each_start(call: Callable[..., Any]) -> None:
    answer = call("run", "joint_cylinder", "--set", *SHORT, "--quiet", "--workers", "1")
    assert answer.code == 0, answer.err
    folder = answer.out.splitlines()[-1].rpartition("/")[0]
    with open(f"{folder}/summary.json") as file:  # noqa: PTH123
        found = json.load(file)
    assert [entry["init"] for entry in found["runs"]] == ["free", "jl"]
    assert all(entry.keys() >= KEYS for entry in found["runs"])
    assert found["runs"][0]["tasks"] == ["joint_limits", "avoidance", "minimum_altitude", "reach"]
    assert "the time is up" in found["runs"][0]["reason"]
    again = call("report", folder)
    assert again.code == 0, again.err


def test_a_campaign_of_them_ends_in_a_report(call: Callable[..., Any]) -> None:
    answer = call("campaign", "joint", "--scenario", "joint_cylinder", "--runs", "1", "--workers",
                  "1", "--keep", "none", "--quiet", "--set", *SHORT)  # fmt: skip
    assert answer.code == 0, answer.err
    with open("out/campaign-joint/summary.json") as file:  # noqa: PTH123
        found = json.load(file)
    assert all(entry.keys() >= KEYS for entry in found["runs"])
    assert len(found["runs"]) == found["trials"]
    with open("out/campaign-joint/report.html") as file:  # noqa: PTH123
        assert "joint_cylinder" in file.read()

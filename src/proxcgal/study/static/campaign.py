"""Static scenes with random draws: what whole-body avoidance gains, and what sensing costs it."""

from collections import Counter
from typing import Any

import numpy as np
import polars as pl

from proxcgal.core.errors import ConfigError
from proxcgal.core.files import NOTHING_M, finite
from proxcgal.core.modes import HOLD
from proxcgal.core.progress import OnProgress
from proxcgal.evaluation.metrics import CONTROLLER_KEYS, COVERAGE_KEYS, SELF_LIMIT_M, Summary
from proxcgal.scenario.loading import load_scenario
from proxcgal.scenario.scenario import CONTROLLERS, Scenario
from proxcgal.study.bootstrap import draw_distances, median_interval, pairs
from proxcgal.study.campaign import (
    Campaign,
    CampaignKind,
    CampaignPlan,
    CampaignRequest,
    Trial,
    ranked,
)
from proxcgal.study.campaign_store import Row
from proxcgal.study.static.draws import draw_scene
from proxcgal.study.static.figures import figures
from proxcgal.study.static.memory_share import memory_summary
from proxcgal.study.static.texts import captions, listings, verdicts
from proxcgal.study.trial_simulation import simulate_trial

SCENES = ("front_plane", "side_plane")
#: Of the trials under 0.05 m: the cloud's nearest point was this much farther away than the panel
#: really was, when that was nearest.
UNSEEN_M = 0.05
#: Controllers whose closest points are looked up among what the sensors had in view.
LOOKED_AT = ("wb", "wb_memory")
#: At the nearest moment and at the end: when, which link, what the cloud showed, and of the truly
#: closest point what the sensors had (`sim.coverage`; LOOKED_AT only) and how long before.
MOMENT_KEYS = tuple(
    form.format(name)
    for name in ("true_min", "true_final")
    for form in (
        "{}_s", "{}_link", "seen_at_{}_m", "believed_at_{}_link", "sighting_at_{}",
        "sighting_age_at_{}_s",
    )
)  # fmt: skip
_AXES = ("x", "y", "z")
_ANGLES = ("roll", "pitch", "yaw")


def plan(request: CampaignRequest) -> Campaign:
    """Every controller on the same draws round each scene; the sensors' noise is the draw's own.

    Raises:
        ProxError: a scene that nothing can be drawn round, or that does not load.
    """
    campaign = CampaignPlan("static", request, SCENES)
    redrawn: dict[str, dict[str, int]] = {}
    if "seed" in (assignment.partition("=")[0].strip() for assignment in request.overrides):
        raise ConfigError("--set seed=...: every draw has its own; --seed fixes them all")
    for source in campaign.scenarios:
        base = load_scenario(source, request.overrides)
        robot = campaign.add_scene(source, base).robot
        reasons: Counter[str] = Counter()
        for number in range(request.runs):
            draw = draw_scene(base, robot, request.seed, number)
            reasons += draw.redrawn
            overrides = (*request.overrides, *draw.overrides)
            for controller in CONTROLLERS:
                campaign.add_trial(
                    draw.scenario, source, overrides, controller, number, robot,
                    scene=base.name, draw=number,
                )  # fmt: skip
        redrawn[base.name] = dict(sorted(reasons.items()))
    return campaign.campaign(perform, _columns(campaign.trials[0]), redrawn=redrawn)


def perform(trial: Trial, report: OnProgress) -> Row:
    """One trial's numbers, beside what was drawn for it."""
    log = simulate_trial(
        trial.scenario, trial.controller, trial.seed, report, robot_digest=trial.robot_digest,
        coverage=trial.controller in LOOKED_AT,
    )  # fmt: skip
    numbers = log.summary()
    row: Row = {key: numbers[key] for key in CONTROLLER_KEYS}
    row |= {key: finite(share) for key, share in log.coverage.numbers().items()}
    for name, tick in (("true_min", log.nearest_tick), ("true_final", len(log.time) - 1)):
        row |= {
            f"{name}_s": float(log.elapsed[tick]),
            f"{name}_link": log.true_link[tick],
            f"seen_at_{name}_m": min(float(log.seen_m[tick]), NOTHING_M),
            f"believed_at_{name}_link": log.control_link[tick],
        }
    kinds = log.sightings or (None, None)
    for name, sighting in zip(("true_min", "true_final"), kinds, strict=True):
        known = sighting is not None and np.isfinite(sighting.age_s)
        row |= {
            f"sighting_at_{name}": sighting.kind if sighting else None,
            f"sighting_age_at_{name}_s": sighting.age_s if sighting and known else None,
        }
    return {
        **row,
        "leaked_points_max": numbers["leaked_points_max"],
        "held_ticks": int((log.mode >= HOLD).sum()),
        **_drawn(trial.scenario),
    }


def _drawn(scenario: Scenario) -> Row:
    panel, offset = scenario.obstacles[0], scenario.goal.offset or ()
    groups = (
        ("panel_{}_m", _AXES, panel.position),
        ("panel_{}_rad", _ANGLES, panel.rpy),
        ("goal_offset_{}_m", _AXES, offset),
        ("q0_{}", range(len(scenario.q0)), scenario.q0),
    )
    return {
        form.format(name): float(value)
        for form, names, values in groups
        for name, value in zip(names, values, strict=True)
    }


def _columns(trial: Trial) -> tuple[str, ...]:
    return (
        *CONTROLLER_KEYS, *COVERAGE_KEYS, *MOMENT_KEYS, "leaked_points_max", "held_ticks",
        *_drawn(trial.scenario),
    )  # fmt: skip


def analyse(table: pl.DataFrame, campaign: Campaign) -> Summary:
    """The numbers of `summary.json`: per scene and controller, and paired over the draws.

    `gain_mm` is the true distance at the end (mean of the last 2 s), wb over sm; `sensing_cost_mm`
    the same, wb_known over wb; `memory` how much of that wb_memory gives back. Each counts the
    draws that all of its controllers ended.
    """
    scenes = {}
    for (scene,), own in table.group_by(["scene"], maintain_order=True):
        ends = draw_distances(own)
        scenes[str(scene)] = {
            "draws": own["draw"].n_unique(),
            "redrawn": campaign.notes["redrawn"][scene],
            "controllers": {
                str(name): _controller(part)
                for (name,), part in own.group_by(["controller"], maintain_order=True)
            },
            "gain_mm": _paired(pairs(ends, "wb", "sm").apart_mm),
            "sensing_cost_mm": _paired(pairs(ends, "wb_known", "wb").apart_mm),
            "memory": memory_summary(own),
        }
    return {
        "robot": campaign.trials[0].scenario.robot,
        "scenes": scenes,
        "self_min_m": table["self_min_m"].min(),
        "self_under_limit": int((table["self_min_m"] < SELF_LIMIT_M).sum()),
    }


def _controller(part: pl.DataFrame) -> Summary:
    done = part.filter(pl.col("error").is_null())
    if done.is_empty():
        return {"trials": 0}
    close = done.filter(pl.col("violations") > 0)
    unseen = close["seen_at_true_min_m"] - close["true_min_m"] > UNSEEN_M
    return {
        "trials": len(done),
        **{
            key: _spread(done[key].to_numpy())
            for key in ("true_min_m", "true_final_m", "goal_error_m")
        },
        "closest_points": {
            key: done[key].mean() if done[key].null_count() < len(done) else None
            for key in COVERAGE_KEYS
        },
        "violating_trials": len(close),
        "violating_share": len(close) / len(done),
        "unseen_trials": int(unseen.sum()),
        "violations": int(done["violations"].sum()),
        "held_trials": int((done["held_ticks"] > 0).sum()),
        "self_min_m": done["self_min_m"].min(),
        "self_under_limit": int((done["self_min_m"] < SELF_LIMIT_M).sum()),
    }


def _spread(values: Any) -> dict[str, float]:
    names = ("min", "p5", "median", "p95", "max")
    return dict(zip(names, np.percentile(values, [0, 5, 50, 95, 100]).tolist(), strict=True))


def _paired(apart: list[float]) -> Summary | None:
    """Distribution of a difference over the draws [mm]; None without any."""
    interval = median_interval(apart)
    if interval is None:
        return None
    return {
        "pairs": len(apart), "median": interval.middle, "low": interval.low, "high": interval.high,
        "p5": float(np.percentile(apart, 5)), "p95": float(np.percentile(apart, 95)),
        "positive_share": float(np.mean(np.array(apart) > 0.0)),
    }  # fmt: skip


KIND = CampaignKind(
    title="Static scenes, drawn at random",
    introduction="Panels, start postures and goals drawn round the paper's static scenes; every "
    "controller meets the same draws, with the same noise of the sensors. wb moves the nearest "
    "point of the whole arm, sm only the sensors' mounting points; wb_known is wb on points of the "
    "scene itself, the ceiling, not a result of ours; wb_memory is wb that remembers what left the "
    "sensors' view.",
    plan=plan, analyse=analyse, listings=listings, verdicts=verdicts, figures=figures,
    captions=captions,
    # Those first that came nearest to the panel, or were so for longer.
    worst=ranked(pl.col("controller") == "wb", true_min_m=False, violations=True),
    worst_of="wb's trials, by the least true distance",
)  # fmt: skip

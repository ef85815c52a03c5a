"""Random operators guide the painting arm: does the guard trip at once, and on nothing else?"""

import numpy as np
import polars as pl

from proxcgal.core.errors import ConfigError
from proxcgal.core.progress import OnProgress
from proxcgal.evaluation.metrics import Summary
from proxcgal.scenario.walkthrough_scenario import WalkScenario
from proxcgal.study.campaign import Campaign, CampaignKind, CampaignPlan, CampaignRequest, Trial
from proxcgal.study.campaign_store import Row
from proxcgal.study.trial_simulation import robot_of
from proxcgal.study.walkthrough.draws import BEHAVIOURS, OWN, draw_walk
from proxcgal.study.walkthrough.figures import STOPPED, figures
from proxcgal.study.walkthrough.texts import captions, listings, verdicts
from proxcgal.trial.walkthrough.playback import play
from proxcgal.trial.walkthrough.setup import WalkSetup
from proxcgal.trial.walkthrough.taught_path import clean_path
from proxcgal.trial.walkthrough.teaching import teach

COLUMNS = (
    "tripped", "own_function", "latency_cycles", "false_trip", "missed", "overrun", "stop_time_s",
    "stop_distance_m", "max_tcp_speed_mps", "least_distance_m", "playback_rms_m", "playback_max_m",
    "playback_trips", "stop_time_bound_s", "min_distance_m",
)  # fmt: skip


def plan(request: CampaignRequest) -> Campaign:
    """Operators in turn compliant, too fast, too near, closing in too fast.

    Raises:
        ProxError: an assignment that does not fit; no compliant path found.
    """
    if request.scenarios:
        raise ConfigError("--scenario: walkthrough draws round its own four scenes")
    campaign = CampaignPlan("walkthrough", request, tuple(BEHAVIOURS.values()))
    redrawn = 0
    for number in range(request.runs):
        behaviour = list(BEHAVIOURS)[number % len(BEHAVIOURS)]
        draw = draw_walk(behaviour, request.seed, number // len(BEHAVIOURS), request.overrides)
        robot = robot_of(draw.scenario)
        campaign.add_robot(behaviour, robot)
        redrawn += draw.redrawn
        campaign.add_trial(
            draw.scenario,
            draw.source,
            draw.overrides,
            "",
            number,
            robot,
            wish=behaviour,
            run=number,
        )
    return campaign.campaign(perform, COLUMNS, redrawn=redrawn)


def perform(trial: Trial, report: OnProgress) -> Row:
    """One operator: taught; where nothing tripped, cleaned and played back."""
    assert isinstance(trial.scenario, WalkScenario)
    setup = WalkSetup.of(trial.scenario, robot_of(trial.scenario, trial.robot_digest))
    log = teach(setup, seed=trial.seed, with_truth=True, on_progress=report)
    tripped = log.trips[0].function if log.trips else None
    stop = log.stop_time_s()
    row: Row = {
        "tripped": tripped or "none",
        "own_function": tripped == OWN.get(str(trial.tags["wish"])),
        "latency_cycles": log.latency_cycles(),
        "false_trip": log.false_trip(),
        "missed": log.missed(),
        "overrun": log.overrun,
        "stop_time_s": stop if stop is None or np.isfinite(stop) else 9.99,
        "stop_distance_m": log.stop_distance_m(),
        "max_tcp_speed_mps": log.max_tcp_speed(),
        "least_distance_m": float(log.distance.min()),
        "playback_rms_m": None,
        "playback_max_m": None,
        "playback_trips": None,
        "stop_time_bound_s": trial.scenario.guard.stop_time,
        "min_distance_m": trial.scenario.guard.min_distance,
    }
    if tripped is None:
        keys = setup.scenario.playback
        path = clean_path(setup.robot, log.time, log.q, step=keys.step, tolerance=keys.tolerance)
        played = play(setup, path)
        row["playback_rms_m"] = float(np.sqrt((played.error_m**2).mean()))
        row["playback_max_m"] = float(played.error_m.max())
        row["playback_trips"] = len(played.log.trips)
    return row


def analyse(table: pl.DataFrame, campaign: Campaign) -> Summary:
    """The numbers of `summary.json`: by what operators did, and over all stops."""
    done = table.filter(pl.col("error").is_null())
    by_behaviour = {
        str(name): _of(part) for (name,), part in done.group_by(["wish"], maintain_order=True)
    }
    stopped = done.filter(STOPPED)
    return {
        "robot": campaign.trials[0].scenario.robot,
        "redrawn": campaign.notes["redrawn"],
        "wishes": by_behaviour,
        "false_trips": int(done["false_trip"].sum()),
        "missed": int(done["missed"].sum()),
        "overruns": int(done["overrun"].sum()),
        "latency_max_cycles": done["latency_cycles"].max(),
        "stop_time_s": _spread(stopped["stop_time_s"]),
        "stop_distance_m": _spread(stopped["stop_distance_m"]),
        "stop_time_bound_s": campaign.trials[0].scenario.guard.stop_time,  # type: ignore[attr-defined]
        "min_distance_m": campaign.trials[0].scenario.guard.min_distance,  # type: ignore[attr-defined]
        "self_min_m": None,
    }


def _of(part: pl.DataFrame) -> Summary:
    stopped = part.filter(STOPPED)
    counts = part["tripped"].value_counts().sort("tripped")
    return {
        "runs": len(part),
        "tripped": dict(counts.iter_rows()),
        "own_function": int((part["own_function"]).sum()),
        "false_trips": int(part["false_trip"].sum()),
        "missed": int(part["missed"].sum()),
        "latency_max_cycles": part["latency_cycles"].max(),
        "stop_time_s": _spread(stopped["stop_time_s"]),
        "stop_distance_m": _spread(stopped["stop_distance_m"]),
        "max_tcp_speed_mps": part["max_tcp_speed_mps"].max(),
        "playback_rms_max_m": part["playback_rms_m"].max(),
        "playback_max_m": part["playback_max_m"].max(),
    }


def _spread(values: pl.Series) -> dict[str, float] | None:
    found = values.drop_nulls().to_numpy()
    if not len(found):
        return None
    names = ("min", "median", "p95", "max")
    return dict(zip(names, np.percentile(found, [0, 50, 95, 100]).tolist(), strict=True))


KIND = CampaignKind(
    title="Walk-through programming",
    introduction="Simulated operators with random hands, bodies and paths guide a painting arm. A "
    "quarter of them keep within the bounds, the others pull too fast, come too near, or let the "
    "arm close in too fast. Engineering figures from a simulation, not a certificate.",
    plan=plan, analyse=analyse, listings=listings, verdicts=verdicts, figures=figures,
    captions=captions,
)  # fmt: skip

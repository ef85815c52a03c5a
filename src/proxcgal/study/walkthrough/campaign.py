"""Random operators guide the painting arm: does the guard trip at once, and on nothing else?"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from proxcgal.core.errors import ConfigError
from proxcgal.evaluation.metrics import Summary
from proxcgal.scenario.walkthrough_scenario import WalkScenario
from proxcgal.study.campaign import Campaign, Trial
from proxcgal.study.figures import DASHED, DPI, GREY
from proxcgal.study.kind import CampaignRequest, Kind, Listing
from proxcgal.study.trials import robot_of
from proxcgal.study.walkthrough.draws import OWN, WISHES, draw_walk
from proxcgal.trial.walkthrough.playback import play
from proxcgal.trial.walkthrough.setup import WalkSetup
from proxcgal.trial.walkthrough.taught_path import clean_path
from proxcgal.trial.walkthrough.teaching import teach

if TYPE_CHECKING:
    from proxcgal.core.progress import OnProgress
    from proxcgal.study.store import Row

COLUMNS = (
    "tripped", "own_function", "latency_cycles", "false_trip", "missed", "overrun", "stop_time_s",
    "stop_distance_m", "max_tcp_speed_mps", "least_distance_m", "playback_rms_m", "playback_max_m",
    "playback_trips", "stop_time_bound_s", "min_distance_m",
)  # fmt: skip
COLOURS = {"overspeed": "#D55E00", "too_close": "#0072B2", "closing_fast": "#009E73"}
#: Trials in which something tripped; without any that ended the column has no type.
_STOPPED = pl.col("tripped").cast(pl.String) != "none"


def plan(request: CampaignRequest) -> Campaign:
    """Operators in turn compliant, too fast, too near, closing in too fast.

    Raises:
        ProxError: an assignment that does not fit; no compliant path found.
    """
    if request.scenarios:
        raise ConfigError("--scenario: walkthrough draws round its own four scenes")
    trials: list[Trial] = []
    scenes: dict[str, str] = {}
    redrawn = 0
    for number in range(request.runs):
        wish = list(WISHES)[number % len(WISHES)]
        draw = draw_walk(wish, request.seed, number // len(WISHES), request.overrides)
        robot = robot_of(draw.scenario)
        redrawn += draw.redrawn
        if wish not in scenes:
            scenes |= {f"robot of {wish}": robot.digest}
        trials.append(
            Trial(
                scenario=draw.scenario, source=draw.source, overrides=draw.overrides,
                controller="", seed=request.seed + number, robot_digest=robot.digest,
                tags={"wish": wish, "run": number},
            )
        )  # fmt: skip
    description = {
        "kind": "walkthrough", "seed": request.seed, "scenarios": list(WISHES.values()),
        "set": list(request.overrides), **scenes,
    }  # fmt: skip
    return Campaign(
        description=description, trials=trials, perform=perform, columns=COLUMNS,
        notes={"redrawn": redrawn},
    )  # fmt: skip


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
    request = {
        str(name): _of(part) for (name,), part in done.group_by(["wish"], maintain_order=True)
    }
    stopped = done.filter(_STOPPED)
    return {
        "robot": campaign.trials[0].scenario.robot,
        "redrawn": campaign.notes["redrawn"],
        "wishes": request,
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
    stopped = part.filter(_STOPPED)
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


def listings(summary: Summary) -> list[Listing]:
    """By what operators did: trips, latency, stops, false trips."""
    rows = []
    for name, found in summary["wishes"].items():
        stop, way = found["stop_time_s"], found["stop_distance_m"]
        rows.append(
            (
                name, OWN.get(name, "none"), str(found["runs"]), str(found["own_function"]),
                str(found["false_trips"]), str(found["missed"]),
                _number(found["latency_max_cycles"], "{:.0f}"),
                _number(stop and stop["median"]), _number(stop and stop["max"]),
                _number(way and way["median"]), _number(way and way["max"]),
                _number(found["max_tcp_speed_mps"], "{:.2f}"),
                _number(found["playback_rms_max_m"], "{:.2f}", 1000.0),
            )
        )  # fmt: skip
    return [
        Listing(
            caption="A trip is false where nothing was truly violated in its cycle, and missed "
            "where something was and nothing tripped; latency from the first truly violated cycle. "
            "True is what the simulator's own kinematics, distances and accelerations say.",
            names=("operator", "to trip", "runs", "as meant", "false", "missed", "latency",
                   "stop, median", "worst", "way, median", "worst", "tool speed", "playback rms"),
            units=("", "", "", "runs", "trips", "", "cycles", "s", "s", "m", "m", "m/s", "mm"),
            rows=rows, left=2,
        )
    ]  # fmt: skip


def _number(value: Any, form: str = "{:.3f}", factor: float = 1.0) -> str:
    return "-" if value is None else form.format(factor * value)


def verdicts(summary: Summary) -> list[str]:
    """Trips, stops and false trips, in words."""
    stop, way = summary["stop_time_s"], summary["stop_distance_m"]
    told = [f"{summary['false_trips']} false trips, {summary['missed']} violations without a trip."]
    if stop is not None and way is not None:
        within = "all" if stop["max"] <= summary["stop_time_bound_s"] else "not all"
        told.append(
            f"Every trip came at most {summary['latency_max_cycles']} cycles after the violation; "
            f"{within} stops ended within {summary['stop_time_bound_s']:g} s (worst "
            f"{stop['max']:.3f} s), on at most {way['max']:.3f} m, against a minimum distance of "
            f"{summary['min_distance_m']:g} m."
        )
    unmeant = {n: f["runs"] - f["own_function"] for n, f in summary["wishes"].items()}
    told += [
        f"{count} {name} runs ended otherwise than meant: {summary['wishes'][name]['tripped']}."
        for name, count in unmeant.items()
        if count
    ]
    return told


def figures(table: pl.DataFrame, _: Summary | None = None) -> dict[str, Figure]:
    """Distribution of stop times and distances; none where nothing stopped."""
    done = table.filter(pl.col("error").is_null(), _STOPPED)
    if done.is_empty():
        return {}
    figure = Figure(figsize=(8.0, 3.7), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    for ax, (column, label, limit) in zip(
        figure.subplots(1, 2, sharey=True),
        (
            ("stop_time_s", "stopping time [s]", "stop_time_bound_s"),
            ("stop_distance_m", "way of the tool [m]", "min_distance_m"),
        ),
        strict=True,
    ):  # fmt: skip
        for name, colour in COLOURS.items():
            values = done.filter(pl.col("wish") == name)[column].drop_nulls().to_numpy()
            if len(values):
                ax.ecdf(values, color=colour, lw=1.6, label=name)
        bound = float(done[limit][0])  # one for all, by --set too
        ax.axvline(bound, color=GREY, lw=1.0, ls=DASHED)
        ax.annotate(
            "declared" if column == "stop_time_s" else "min_distance",
            (bound, 0.04),
            xytext=(-4, 0),
            textcoords="offset points",
            ha="right",
            fontsize=9,
            color=GREY,
        )
        most = done[column].drop_nulls().max()  # what is over the bound must be seen
        ax.set_xlim(0.0, max(1.15 * bound, 1.05 * float(most or 0.0)))  # type: ignore[arg-type]
        ax.set_xlabel(label, fontsize=10)
        ax.tick_params(labelsize=9)
        ax.spines[["top", "right"]].set_visible(False)
    figure.axes[0].set_ylabel("share of stops [-]", fontsize=10)
    figure.axes[0].set_ylim(0.0, 1.04)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return {"stops.png": figure}


def captions(summary: Summary) -> dict[str, str]:
    """What the figure shows."""
    return {
        "stops.png": "Stopping times and ways of the tool, from the trip to rest, as simulated "
        "with weight and brakes: the share of stops up to each value, by what the operator did. "
        f"Dashed: the declared stopping time of {summary['stop_time_bound_s']:g} s, and the "
        f"minimum distance of {summary['min_distance_m']:g} m."
    }


def worst(table: pl.DataFrame) -> list[str]:
    """None is recorded: the command of each run repeats it, its recording beside it."""
    return []


KIND = Kind(
    title="Walk-through programming",
    introduction="Simulated operators with random hands, bodies and paths guide a painting arm. A "
    "quarter of them keep within the bounds, the others pull too fast, come too near, or let the "
    "arm close in too fast. Engineering figures from a simulation, not a certificate.",
    plan=plan, analyse=analyse, listings=listings, verdicts=verdicts, figures=figures,
    captions=captions, worst=worst,
)  # fmt: skip

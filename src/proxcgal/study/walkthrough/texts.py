"""Texts of the walk-throughs' campaign: table, verdicts, caption."""

from collections.abc import Iterator
from typing import Any

from proxcgal.evaluation.metrics import Summary
from proxcgal.study.campaign import Listing
from proxcgal.study.walkthrough.draws import OWN


def listings(summary: Summary) -> list[Listing]:
    """By what operators did: trips, latency, stops, false trips."""
    rows = []
    for name, found in summary["wishes"].items():
        stop, way = found["stop_time_s"] or {}, found["stop_distance_m"] or {}
        rows.append(
            (
                name, OWN.get(name, "none"), str(found["runs"]), str(found["own_function"]),
                str(found["false_trips"]), str(found["missed"]),
                _number(found["latency_max_cycles"], "{:.0f}"),
                _number(stop.get("median")), _number(stop.get("max")),
                _number(way.get("median")), _number(way.get("max")),
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


def verdicts(summary: Summary) -> Iterator[str]:
    """Trips, stops and false trips, a sentence each."""
    stop, way = summary["stop_time_s"], summary["stop_distance_m"]
    yield f"{summary['false_trips']} false trips, {summary['missed']} violations without a trip."
    if stop is not None and way is not None:
        within = "all" if stop["max"] <= summary["stop_time_bound_s"] else "not all"
        yield (
            f"Every trip came at most {summary['latency_max_cycles']} cycles after the violation; "
            f"{within} stops ended within {summary['stop_time_bound_s']:g} s (worst "
            f"{stop['max']:.3f} s), on at most {way['max']:.3f} m, against a minimum distance of "
            f"{summary['min_distance_m']:g} m."
        )
    for name, found in summary["wishes"].items():
        if count := found["runs"] - found["own_function"]:
            yield f"{count} {name} runs ended otherwise than meant: {found['tripped']}."


def captions(summary: Summary) -> dict[str, str]:
    """What the figure shows."""
    return {
        "stops.png": "Stopping times and ways of the tool, from the trip to rest, as simulated "
        "with weight and brakes: the share of stops up to each value, by what the operator did. "
        f"Dashed: the declared stopping time of {summary['stop_time_bound_s']:g} s, and the "
        f"minimum distance of {summary['min_distance_m']:g} m."
    }

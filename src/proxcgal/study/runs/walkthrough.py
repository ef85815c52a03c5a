"""Run of a walk-through: teach, record, play back, draw, and say what was found."""

import csv
from pathlib import Path
from typing import Any

from proxcgal.core.errors import ConfigError
from proxcgal.core.files import write_bytes, write_json, write_text
from proxcgal.core.progress import ProgressBar, announce
from proxcgal.core.provenance import origin
from proxcgal.core.tables import aligned
from proxcgal.scenario.walkthrough_scenario import WalkScenario
from proxcgal.study.plotting import png
from proxcgal.study.runs.preparation import ready_folders
from proxcgal.study.walkthrough.figures import ratings_figure, teach_figure, trip_figure
from proxcgal.trial.walkthrough.run import WalkResult, run_walk
from proxcgal.trial.walkthrough.setup import WalkSetup
from proxcgal.trial.walkthrough.taught_path import to_csv, to_trajectory
from proxcgal.trial.walkthrough.teaching import REACHED, check_duration

RECORDING, FIGURE, TABLE, TRAJECTORY = "taught.mcap", "walkthrough.png", "path.csv", "path.json"
RATINGS = "ratings.png"
LEAST, MOST = 0.0, 10.0  # of a rating


def run_walkthrough(scenario: WalkScenario, folder: Path, command: str, *, quiet: bool) -> None:
    """Runs it and fills the folder; prints the guard's bounds and the results.

    Args:
        scenario: what to run.
        folder: of the results.
        command: as typed; for `run.json`.
        quiet: no progress on stderr.

    Raises:
        ConfigError: what does not fit, a guard that contradicts itself, a folder that cannot be
            written.
        SimulationError: MuJoCo warned.
    """
    about = origin(command)
    ratings = read_ratings(Path(scenario.ratings)) if scenario.ratings else {}
    announce(f"setting up {scenario.name}", quiet=quiet)
    setup = WalkSetup.of(scenario)
    check_duration(scenario)  # before the files of an older run are removed
    guard = setup.notes()
    print("\n".join(guard))
    with ready_folders([folder]):
        for name in (RECORDING, FIGURE, TABLE, TRAJECTORY, RATINGS):
            (folder / name).unlink(missing_ok=True)
        with ProgressBar("teaching", [1.0], "", quiet=quiet) as progress:
            result = run_walk(
                setup, seed=scenario.seed, recording=folder / RECORDING,
                on_progress=lambda share: progress.shares([share]),
            )  # fmt: skip
        if ratings:
            write_bytes(folder / RATINGS, png(ratings_figure(ratings)))
        summary = _write(setup, result, folder, about | {"guard": guard})
    print("\n".join(walkthrough_lines(summary)))


def _write(
    setup: WalkSetup, result: WalkResult, folder: Path, about: dict[str, Any]
) -> dict[str, Any]:
    scenario = setup.scenario
    title = f"{scenario.name}: {setup.robot.name}, seed {scenario.seed}"
    if result.log.trips:
        figure = trip_figure(result.log, title=title, window=scenario.magnified)
    else:
        figure = teach_figure(result, title=title, hand_guiding=scenario.hand_guiding_speed)
    write_bytes(folder / FIGURE, png(figure))
    if result.path is not None:
        write_text(folder / TABLE, to_csv(setup.robot, result.path))
        write_json(folder / TRAJECTORY, to_trajectory(setup.robot, result.path))
    summary = {
        "scenario": scenario.name, "robot": setup.robot.name, "seed": scenario.seed,
        **result.summary(), "min_distance_m": scenario.guard.min_distance,
        "iso_distance_m": setup.bounds.protective_distance,
        "monitored_pairs": list(setup.monitored_pairs),
        "accepted": [{"item": item, "text": text} for item, text in setup.bounds.accepted],
        "self_min_m": None,
    }  # fmt: skip
    write_text(folder / "scenario.toml", scenario.to_toml())
    write_json(folder / "run.json", {**about, "description": scenario.description})
    write_json(folder / "summary.json", summary)
    return summary


def walkthrough_lines(summary: dict[str, Any]) -> list[str]:
    """What a run found, for a terminal and for a page."""
    found = [
        f"{_cut(trip)}, {summary['latency_cycles']} cycles after the first true violation"
        for trip in summary["trips"]
    ]
    if summary["trips"]:
        stop = summary["stop_time_s"]
        found.append(
            "the arm did not come to rest while it was watched" if stop is None else
            f"at rest after {stop:.3f} s and {summary['stop_distance_m']:.3f} m of the tool, which "
            f"came to {summary['peak_after_cut_mps']:.2f} m/s before the brakes held it; "
            f"minimum distance {summary['min_distance_m']:.3f} m, ISO/TS 15066 "
            f"{summary['iso_distance_m']:.2f} m"
        )  # fmt: skip
    else:
        found.append(f"no trip; tool up to {summary['max_tcp_speed_mps']:.2f} m/s")
    if played := summary["playback"]:
        error = summary["playback_error_m"]
        found.append(
            f"taught in {summary['teaching_time_s']:.1f} s, cleaned by at most "
            f"{1000 * played['cleaned_by_m']:.2f} mm, "
            + (
                f"played back up to {_cut(played['trips'][0])}" if played["trips"] else
                f"played back in {played['time_s']:.1f} s within {1000 * error['max']:.2f} mm "
                f"({1000 * error['rms']:.2f} mm rms), no trip"
            )
        )  # fmt: skip
    if slow := summary["hand_guiding"]:
        found.append(
            f"by the hand-guiding rules the same path takes {slow['teaching_time_s']:.1f} s to "
            f"teach (tool up to {slow['max_tcp_speed_mps']:.3f} m/s, {slow['trips']} trips)"
        )
        found += _unfinished("by the hand-guiding rules", slow)
    found += _unfinished("at the process's speed", summary)
    if summary["stops"]:
        head = ("stop", "brakes", "time", "distance")
        rows = [
            (
                s["case"], f"{100 * s['brake_scale']:.0f}",
                "none" if s["stop_time_s"] is None else f"{s['stop_time_s']:.3f}",
                f"{s['stop_distance_m']:.3f}",
            )
            for s in summary["stops"]
        ]  # fmt: skip
        found.append(aligned([head, ("", "[%]", "[s]", "[m]"), *rows], left=1, heads=2))
    found += [summary["stops_note"]] if summary.get("stops_note") else []
    return found


def _cut(trip: dict[str, Any]) -> str:
    """When and why the guard cut the torque."""
    return (
        f"{trip['time_s']:.3f} s: {trip['function']} {trip['value']:.3f}, allowed "
        f"{trip['limit']:.3f}: torque off"
    )


def _unfinished(how: str, taught: dict[str, Any]) -> list[str]:
    """Says where a teaching without a trip did not come to its path's end."""
    left = taught.get("left_m")
    if left is None or left <= REACHED:
        return []
    return [f"{how} the hand let go {left:.3f} m from the path's end: times do not compare"]


def read_ratings(path: Path) -> dict[str, list[float]]:
    """Ratings by indicator, in the file's order: a column an indicator, a row a tester.

    Args:
        path: of a CSV file whose first row names the indicators; ratings are 0 to 10, as in [WT]
            4.1. An empty cell is no rating. It may begin with a byte order mark, as spreadsheets
            write it.

    Raises:
        ConfigError: a file that cannot be read, and all cells that are no rating, one line each.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            head, *rows = list(csv.reader(file)) or [[]]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ConfigError(f"ratings {path}: cannot be read: {error}") from None
    names = [name.strip() for name in head]
    if not any(names) or not rows or len(set(names)) < len(names):
        raise ConfigError(
            f"ratings {path}: a first row of different indicators and a row for each tester are "
            "needed"
        )
    found: dict[str, list[float]] = {name: [] for name in names}
    problems = []
    for number, row in enumerate(rows, start=2):
        if len(row) > len(names):
            problems.append(f"ratings {path}: line {number}: {len(row)} cells, {len(names)} named")
        for name, cell in zip(names, row, strict=False):
            if not cell.strip():
                continue
            try:
                value = float(cell)
            except ValueError:
                value = float("nan")
            if LEAST <= value <= MOST:
                found[name].append(value)
            else:
                problems.append(
                    f"ratings {path}: line {number}, {name} = {cell!r}: a number from 0 to 10"
                )
    if problems:
        raise ConfigError("\n".join(problems))
    return {name: values for name, values in found.items() if values}

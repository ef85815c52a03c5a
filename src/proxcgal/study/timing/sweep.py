"""The whole timing grid: inputs prepared, every cell measured, numbers and pictures written."""

from collections.abc import Sequence
from pathlib import Path

from proxcgal.core.errors import ConfigError
from proxcgal.core.files import as_json, write_bytes
from proxcgal.core.progress import ProgressBar
from proxcgal.core.provenance import machine, origin
from proxcgal.scenario.scenario import Scenario
from proxcgal.study.plotting import png
from proxcgal.study.runs.preparation import ready_folders
from proxcgal.study.timing.cloud_figure import cloud_figure
from proxcgal.study.timing.comparison import compare, cycle_verdict, sweep_table
from proxcgal.study.timing.grid import (
    ALGORITHMS,
    FULL,
    QUICK,
    Effort,
    TimingCell,
    sweep_summary,
    time_cells,
)
from proxcgal.study.timing.inputs import REACH, VERTICES, Inputs, grid_inputs
from proxcgal.study.timing.timing_figure import timing_figure

QUICK_VERTICES = (100, 1000, 10000)
QUICK_CLOUDS = ("raw", "1m")
DRAWN_VERTICES = (100, 1000, 10000)  # resolutions of the robot in the picture of the clouds


def run_sweep(
    scenarios: Sequence[Scenario], folder: Path, command: str, *, short: bool, quiet: bool
) -> None:
    """Measures, fills the folder, the report apart, and prints table and verdict.

    Args:
        scenarios: robots, each with a posture, sensors and a scene.
        folder: of the results; an earlier sweep's files there are replaced.
        command: as typed; for `run.json`.
        short: fewer cells, each measured for a shorter time.
        quiet: no progress on stderr.

    Raises:
        ProxError: scenarios that do not fit; the two methods answer differently.
        KeyboardInterrupt: with a message of what was kept.
    """
    vertices, clouds = (QUICK_VERTICES, QUICK_CLOUDS) if short else (VERTICES, tuple(REACH))
    about = origin(command)
    try:
        with ready_folders([folder]):
            grids = _prepare(scenarios, vertices, clouds, quiet)
            cells = _measure(grids, QUICK if short else FULL, quiet)
            summary = sweep_summary(cells, machine())
            files = {f"{scenario.name}.toml": scenario.to_toml().encode() for scenario in scenarios}
            files |= _pictures(cells, grids) | {"samples.csv": _samples(cells)}
            files |= {"run.json": as_json(about), "summary.json": as_json(summary)}
            for name, content in files.items():
                write_bytes(folder / name, content)
    except KeyboardInterrupt:
        raise KeyboardInterrupt("nothing was kept") from None
    comparisons = compare(summary["cells"])
    print(sweep_table(comparisons))
    print(cycle_verdict(comparisons))


def _prepare(
    scenarios: Sequence[Scenario], vertices: Sequence[int], clouds: Sequence[str], quiet: bool
) -> list[list[Inputs]]:
    """All inputs, robot by robot, before anything is written: what does not fit fails early."""
    grids: list[list[Inputs]] = []
    count = len(vertices) * len(clouds)
    with ProgressBar("preparing", [1.0] * (len(scenarios) * count), "", quiet=quiet) as progress:
        for scenario in scenarios:
            grid: list[Inputs] = []
            for inputs in grid_inputs(scenario, vertices, clouds):
                grid.append(inputs)
                progress.first(len(grids) * count + len(grid))
            grids.append(grid)
            progress.finished(f"{scenario.name}: meshes and clouds are ready")
    robots = [grid[0].robot.name for grid in grids]
    if len(set(robots)) < len(robots) or not robots:
        names = ", ".join(robots) or "none"
        raise ConfigError(f"--scenario: robots {names}: one scenario for each robot is needed")
    return grids


def _measure(grids: Sequence[Sequence[Inputs]], effort: Effort, quiet: bool) -> list[TimingCell]:
    """One cell after the other, in this process and nothing beside it."""
    everything = [inputs for grid in grids for inputs in grid]
    cells: list[TimingCell] = []
    with ProgressBar("measuring", [1.0] * len(everything), "", quiet=quiet) as progress:
        for row, inputs in enumerate(everything, 1):
            found = list(time_cells([inputs], effort))
            cells += found
            progress.first(row)
            times = (f"{cell.method} {cell.median_us:.0f}" for cell in found)
            progress.finished(
                f"{inputs.robot.name}, {inputs.vertices} vertices, {inputs.cloud} cloud: "
                f"Algorithms 1 and 2: {', '.join(times)} us"
            )
    return cells


def _samples(cells: Sequence[TimingCell]) -> bytes:
    """Every single time, a line each."""
    lines = ["robot,vertices,cloud,points,algorithm,method,time_us"]
    for c in cells:
        begin = f"{c.robot},{c.vertices},{c.cloud},{c.points},{c.algorithm},{c.method}"
        lines += [f"{begin},{time:.3f}" for time in c.samples_us.tolist()]
    return ("\n".join(lines) + "\n").encode()


def _pictures(cells: Sequence[TimingCell], grids: Sequence[Sequence[Inputs]]) -> dict[str, bytes]:
    """The figures' files: times of both algorithms, clouds of every robot."""
    drawn = {f"algorithm{n}.png": png(timing_figure(cells, n)) for n in ALGORITHMS}
    for grid in grids:
        near_W = next(inputs.environment_W for inputs in grid if inputs.cloud == "1m")
        whole = [i for i in grid if i.cloud == "raw" and i.vertices in DRAWN_VERTICES]
        drawn[f"clouds_{grid[0].robot.name}.png"] = png(cloud_figure(whole, near_W))
    return drawn

"""`proxcgal sweep`: the timing grid of the paper, and beyond it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from proxcgal.cli.options import Flag
from proxcgal.core.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from proxcgal.scenario.scenario import Scenario
    from proxcgal.study.timing.grid import Cell, Effort
    from proxcgal.study.timing.inputs import Inputs

QUICK_VERTICES = (100, 1000, 10000)
QUICK_CLOUDS = ("raw", "1m")
DRAWN_VERTICES = (100, 1000, 10000)  # resolutions of the robot in the picture of the clouds


@dataclass(frozen=True)
class SweepOptions:
    """Time Algorithms 1 and 2, literal and accelerated, over meshes and clouds.

    A UR10e and a Panda, 100 to 10000 vertices a link, clouds of about 200, 600 and 1600 points:
    the grid of the paper. One thread; a quarter of an hour at most, --quick 40 s (the first time,
    preparing the meshes comes on top). Writes summary.json, samples.csv (every single time),
    figures and report.html to DIR.

    Examples:
      proxcgal sweep --quick
      proxcgal sweep --out out/timing
      proxcgal sweep --scenario my_cell.toml --out out/mine
    """

    quick: Flag = False
    """Three resolutions and two clouds, each measured for a shorter time."""
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")] = Path("out/sweep")
    """Where results go; an earlier sweep's files there are replaced."""
    scenario: Annotated[
        tuple[str, ...], tyro.conf.arg(metavar="NAME|PATH ...", help_behavior_hint="")
    ] = ("timing_ur10e", "timing_panda")
    """Robots, each with a posture, sensors and a scene: its first scan is the cloud."""
    quiet: Flag = False
    """No progress on stderr."""


def sweep_command(options: SweepOptions, command: str) -> int:
    """Measures, writes, prints the table; the report's path is the last line."""
    from proxcgal.core.files import as_json, write_bytes
    from proxcgal.core.provenance import machine, origin
    from proxcgal.report.report import write_report
    from proxcgal.scenario.loading import load_scenario
    from proxcgal.study.runs.results import ready, remove_empty
    from proxcgal.study.timing.grid import FULL, QUICK, sweep_summary
    from proxcgal.study.timing.inputs import REACH, VERTICES
    from proxcgal.study.timing.ratios import compare, cycle_verdict, sweep_table

    scenarios = [load_scenario(name) for name in options.scenario]
    vertices, clouds = (QUICK_VERTICES, QUICK_CLOUDS) if options.quick else (VERTICES, tuple(REACH))
    about = origin(command)
    made = ready([options.out])
    try:
        grids = _prepare(scenarios, vertices, clouds, options.quiet)
        cells = _measure(grids, QUICK if options.quick else FULL, options.quiet)
        summary = sweep_summary(cells, machine())
        files = {f"{scenario.name}.toml": scenario.to_toml().encode() for scenario in scenarios}
        files |= _pictures(cells, grids) | {"samples.csv": _samples(cells)}
        files |= {"run.json": as_json(about), "summary.json": as_json(summary)}
        for name, content in files.items():
            write_bytes(options.out / name, content)
    except KeyboardInterrupt:
        raise KeyboardInterrupt("nothing was kept") from None
    finally:
        remove_empty(made)
    comparisons = compare(summary["cells"])
    print(sweep_table(comparisons))
    print(cycle_verdict(comparisons))
    print(write_report(options.out))
    return 0


def _prepare(
    scenarios: Sequence[Scenario], vertices: Sequence[int], clouds: Sequence[str], quiet: bool
) -> list[list[Inputs]]:
    """All inputs, robot by robot, before anything is written: what does not fit is told first."""
    from proxcgal.core.progress import ProgressBar
    from proxcgal.study.timing.inputs import grid_inputs

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
        told = ", ".join(robots) or "none"
        raise ConfigError(f"--scenario: robots {told}: one scenario for each robot is needed")
    return grids


def _measure(grids: Sequence[Sequence[Inputs]], effort: Effort, quiet: bool) -> list[Cell]:
    """One cell after the other, in this process and nothing beside it."""
    from proxcgal.core.progress import ProgressBar
    from proxcgal.study.timing.grid import time_cells

    everything = [inputs for grid in grids for inputs in grid]
    cells: list[Cell] = []
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


def _samples(cells: Sequence[Cell]) -> bytes:
    """Every single time, a line each."""
    lines = ["robot,vertices,cloud,points,algorithm,method,time_us"]
    for c in cells:
        begin = f"{c.robot},{c.vertices},{c.cloud},{c.points},{c.algorithm},{c.method}"
        lines += [f"{begin},{time:.3f}" for time in c.samples_us.tolist()]
    return ("\n".join(lines) + "\n").encode()


def _pictures(cells: Sequence[Cell], grids: Sequence[Sequence[Inputs]]) -> dict[str, bytes]:
    """The figures' files: times of both algorithms, clouds of every robot."""
    from proxcgal.study.figures import png
    from proxcgal.study.timing.cloud_figure import cloud_figure
    from proxcgal.study.timing.figures import timing_figure
    from proxcgal.study.timing.grid import ALGORITHMS

    drawn = {f"algorithm{n}.png": png(timing_figure(cells, n)) for n in ALGORITHMS}
    for grid in grids:
        near_W = next(inputs.environment_W for inputs in grid if inputs.cloud == "1m")
        whole = [i for i in grid if i.cloud == "raw" and i.vertices in DRAWN_VERTICES]
        drawn[f"clouds_{grid[0].robot.name}.png"] = png(cloud_figure(whole, near_W))
    return drawn

"""`proxcgal sweep`: the timing grid of the paper, and beyond it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from proxcgal.cli.options import Flag


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
    from proxcgal.report.write_report import write_report
    from proxcgal.scenario.loading import load_scenario
    from proxcgal.study.timing.sweep import run_sweep

    scenarios = [load_scenario(name) for name in options.scenario]
    run_sweep(scenarios, options.out, command, short=options.quick, quiet=options.quiet)
    print(write_report(options.out))
    return 0

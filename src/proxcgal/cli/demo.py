"""`proxcgal demo`: both static scenes with all controllers, and one report of them."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from proxcgal.cli.options import Flag, Number, Settings, checked_workers, flat

SCENARIOS = ("front_plane", "side_plane")


@dataclass(frozen=True)
class DemoOptions:
    """Run the static scenes with all controllers: table, figures, moving pictures, one report.

    Examples:
      proxcgal demo
      proxcgal demo --out /tmp/demo --seed 7
    """

    out: Annotated[Path, tyro.conf.arg(metavar="DIR")] = Path("out/demo")
    """Where results go; an earlier demo's files there are replaced."""
    seed: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Fixes every random draw."""
    workers: Number = None
    """Processes that simulate; left out: one a processor."""
    set: Settings = ()
    """Change keys of both scenarios, values as in TOML: controller.d_min=0.25"""
    no_picture: Flag = False
    """Leave the moving pictures out."""
    quiet: Flag = False
    """No progress on stderr."""


def demo_command(options: DemoOptions, command: str) -> int:
    """Runs the demo; the report's path is the last line printed."""
    from proxcgal.report.write_report import write_report
    from proxcgal.scenario.loading import load_scenario
    from proxcgal.scenario.scenario import USUAL
    from proxcgal.study.runs.scenes import ScenePlan, run_scenes

    workers = checked_workers(options.workers)
    changes = [f"seed={options.seed}", *flat(options.set)]
    scenarios = [load_scenario(name, changes) for name in SCENARIOS]
    plans = [
        ScenePlan(scenario=scenario, controllers=USUAL, folder=options.out / scenario.name)
        for scenario in scenarios
    ]
    failed = run_scenes(
        plans, command, together=options.out, workers=workers,
        pictures=not options.no_picture, quiet=options.quiet,
    )  # fmt: skip
    print(write_report(options.out))
    return 1 if failed else 0


if __name__ == "__main__":
    from proxcgal.cli.main import call

    sys.exit(call("demo", sys.argv[1:]))

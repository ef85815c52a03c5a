"""`proxcgal coverage`: what the sensors see of the space round the arm."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from proxcgal.cli.options import ControllerName, Flag, Number, Settings, flat
from proxcgal.core.errors import ConfigError


@dataclass(frozen=True)
class CoverageOptions:
    """Simulate a scene, and show what of the space round the arm its sensors saw, and when.

    Looks back from the moment at which the arm was nearest to the scene: what was in view then,
    within the memory's time before, longer ago, never. Writes coverage.png and summary.json to DIR.

    Examples:
      proxcgal coverage front_plane
      proxcgal coverage memory_blind_post --controller wb_memory
      proxcgal coverage side_plane --at 0
    """

    scenario: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENARIO")]
    """A name that `proxcgal scenarios` lists, or a path to a TOML file."""
    controller: Annotated[ControllerName, tyro.conf.arg(metavar="wb|sm|wb_known|wb_memory")] = "wb"
    """Whose path."""
    at: Annotated[float | None, tyro.conf.arg(metavar="T", help_behavior_hint="")] = None
    """The moment [s] instead of the nearest; 0: the posture at the start alone."""
    seed: Number = None
    """Fixes every random draw; instead of the scenario's."""
    set: Settings = ()
    """Change keys of the scenario, values as in TOML: skin.rings.0.sensors=6"""
    out: Annotated[
        Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(default: out/coverage)")
    ] = None
    """Where results go."""
    quiet: Flag = False
    """No progress on stderr."""


def coverage_command(options: CoverageOptions, command: str) -> int:
    """Simulates, looks, writes; prints the shares."""
    from proxcgal.scenario.loading import load_scenario
    from proxcgal.study.runs.coverage import run_coverage

    changes = [] if options.seed is None else [f"seed={options.seed}"]
    scenario = load_scenario(options.scenario, changes + flat(options.set))
    if scenario.kind == "walkthrough":
        raise ConfigError(
            f'{options.scenario} has kind = "walkthrough", whose arm carries no sensors: '
            "there is nothing to cover"
        )
    if options.at is not None and not 0.0 <= options.at <= scenario.duration:
        raise ConfigError(
            f"--at {options.at:g}: must be between 0 and the scenario's {scenario.duration:g} s"
        )
    run_coverage(
        scenario,
        options.controller,
        options.at,
        options.out or Path("out/coverage"),
        quiet=options.quiet,
    )
    return 0

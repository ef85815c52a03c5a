"""`proxcgal coverage`: what the sensors see of the space round the arm."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from proxcgal.cli.options import ControllerName, Flag, Number, Settings, flat

STEP_S = 0.2  # [s] between the postures of a path that are looked from


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
    import numpy as np

    from proxcgal.core.errors import ConfigError
    from proxcgal.core.files import finite, write_bytes, write_json
    from proxcgal.core.progress import ProgressBar, announce
    from proxcgal.evaluation.blind_volume import REACH_M, blind_volume
    from proxcgal.evaluation.ground_truth import GroundTruth
    from proxcgal.evaluation.metrics import coverage_lines
    from proxcgal.scenario.loading import load_scenario
    from proxcgal.scenario.setup import Setup
    from proxcgal.study.coverage_figure import coverage_figure
    from proxcgal.study.figures import png
    from proxcgal.study.runs.results import check, ready
    from proxcgal.trial.trial import run_trial

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
    check(scenario, (options.controller,), quiet=options.quiet)
    setup = Setup.of(scenario)
    folder = options.out or Path("out") / "coverage"
    ready([folder])
    with ProgressBar("simulating", [scenario.duration], "s", quiet=options.quiet) as progress:
        log = run_trial(
            scenario, options.controller, robot=setup.robot, sparse_truth=True, coverage=True,
            on_progress=lambda share: progress.shares([share]),
        )  # fmt: skip
        progress.finished(f"{scenario.name} {options.controller}")
    announce("looking from every posture", quiet=options.quiet)
    nearest = int(np.nanargmin(log.true_m)) if np.isfinite(log.true_m).any() else len(log.q) - 1
    tick = nearest if options.at is None else int(np.argmin(np.abs(log.elapsed - options.at)))
    step = max(round(STEP_S * scenario.simulation.control_hz), 1)
    ticks = list(range(tick, -1, -step))[::-1]
    stamps, postures = [float(log.elapsed[t]) for t in ticks], [log.q[t] for t in ticks]
    volume = blind_volume(setup, stamps, postures)
    closest = GroundTruth(setup.robot, setup.scene).nearest(log.q[tick], stamps[-1])
    memory_s = scenario.controller.memory.memory_s
    figure = coverage_figure(
        setup, stamps, postures, volume, nearest_W=closest.obstacle_W,
        title=f"{scenario.name}, {options.controller}: what was in view round the arm at "
        f"{stamps[-1]:.1f} s",
    )  # fmt: skip
    write_bytes(folder / "coverage.png", png(figure))
    shares = {
        "not_in_view": volume.share_unseen_for(0.0),
        "not_within_memory": volume.share_unseen_for(memory_s),
        "never_seen": float(np.isinf(volume.ages).mean()),
    }
    numbers = {key: finite(share) for key, share in log.coverage.numbers().items()}
    summary = {
        "scenario": scenario.name, "robot": setup.robot.name, "seed": scenario.seed,
        "controller": options.controller, "time_s": stamps[-1], "memory_s": memory_s,
        "reach_m": REACH_M, "volume": shares, "closest_points": numbers,
    }  # fmt: skip
    write_json(folder / "summary.json", summary)
    print(
        f"{scenario.name}, {options.controller}, {stamps[-1]:.1f} s: of the volume within "
        f"{REACH_M:g} m of the arm {100 * shares['not_in_view']:.0f} % is not in view, "
        + (
            f"{100 * shares['not_within_memory']:.0f} % was not for {memory_s:g} s, "
            if stamps[-1] > memory_s
            else ""
        )
        + f"{100 * shares['never_seen']:.0f} % never was since the run began"
    )
    for line in coverage_lines(scenario.name, {options.controller: numbers}):
        print(f"{line}, over the whole run of {scenario.duration:g} s")
    print(folder / "coverage.png")
    return 0

"""A run looked at for its coverage: what of the space round the arm its sensors saw, and when."""

from pathlib import Path

import numpy as np

from proxcgal.core.files import finite, write_bytes, write_json
from proxcgal.core.progress import ProgressBar, announce
from proxcgal.evaluation.blind_volume import REACH_M, blind_volume
from proxcgal.evaluation.ground_truth import GroundTruth
from proxcgal.evaluation.metrics import coverage_lines
from proxcgal.scenario.scenario import Scenario
from proxcgal.scenario.setup import Setup
from proxcgal.study.coverage_figure import coverage_figure
from proxcgal.study.plotting import png
from proxcgal.study.runs.preparation import check_setup, ready_folders
from proxcgal.trial.trial import run_trial

STEP_S = 0.2  # [s] between the postures of a path that are looked from


def run_coverage(
    scenario: Scenario, controller: str, at: float | None, folder: Path, *, quiet: bool
) -> None:
    """Simulates, looks back from one moment, fills the folder, and prints the shares.

    Args:
        scenario: with sensors.
        controller: whose path.
        at: [s] the moment; None: when the arm was nearest to the scene.
        folder: gets `coverage.png` and `summary.json`.
        quiet: no progress on stderr.

    Raises:
        ProxError: what of the scenario does not fit, a folder that cannot be written.
    """
    check_setup(scenario, (controller,), quiet=quiet)
    setup = Setup.of(scenario)
    ready_folders([folder])
    with ProgressBar("simulating", [scenario.duration], "s", quiet=quiet) as progress:
        log = run_trial(
            scenario, controller, robot=setup.robot, sparse_truth=True, coverage=True,
            on_progress=lambda share: progress.shares([share]),
        )  # fmt: skip
        progress.finished(f"{scenario.name} {controller}")
    announce("looking from every posture", quiet=quiet)
    nearest = int(np.nanargmin(log.true_m)) if np.isfinite(log.true_m).any() else len(log.q) - 1
    tick = nearest if at is None else int(np.argmin(np.abs(log.elapsed - at)))
    step = max(round(STEP_S * scenario.simulation.control_hz), 1)
    ticks = list(range(tick, -1, -step))[::-1]
    stamps, postures = [float(log.elapsed[t]) for t in ticks], [log.q[t] for t in ticks]
    volume = blind_volume(setup, stamps, postures)
    closest = GroundTruth(setup.robot, setup.scene).nearest(log.q[tick], stamps[-1])
    memory_s = scenario.controller.memory.memory_s
    figure = coverage_figure(
        setup, stamps, postures, volume, nearest_W=closest.obstacle_W,
        title=f"{scenario.name}, {controller}: what was in view round the arm at "
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
        "controller": controller, "time_s": stamps[-1], "memory_s": memory_s,
        "reach_m": REACH_M, "volume": shares, "closest_points": numbers,
    }  # fmt: skip
    write_json(folder / "summary.json", summary)
    print(
        f"{scenario.name}, {controller}, {stamps[-1]:.1f} s: of the volume within "
        f"{REACH_M:g} m of the arm {100 * shares['not_in_view']:.0f} % is not in view, "
        + (
            f"{100 * shares['not_within_memory']:.0f} % was not for {memory_s:g} s, "
            if stamps[-1] > memory_s
            else ""
        )
        + f"{100 * shares['never_seen']:.0f} % never was since the run began"
    )
    for line in coverage_lines(scenario.name, {controller: numbers}):
        print(f"{line}, over the whole run of {scenario.duration:g} s")
    print(folder / "coverage.png")

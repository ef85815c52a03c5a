"""A run looked at for its coverage: what of the space round the arm its sensors saw, and when."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from proxcgal.core.files import finite, write_bytes, write_json
from proxcgal.core.progress import ProgressBar, announce
from proxcgal.core.transforms import placed
from proxcgal.core.typing import Array
from proxcgal.evaluation.blind_volume import (
    REACH_M,
    BlindVolume,
    blind_volume,
    distances,
    last_seen,
)
from proxcgal.evaluation.ground_truth import GroundTruth
from proxcgal.evaluation.metrics import coverage_lines
from proxcgal.scenario.scenario import Scenario
from proxcgal.scenario.setup import Setup
from proxcgal.study.plotting import DOTTED, GREY, legend_below, new_figure, png, tidy_axes
from proxcgal.study.runs.preparation import check_setup, ready_folders
from proxcgal.trial.trial import run_trial

_STEP_M = 0.025  # between the points of a section
_ARM = "#6B6B6B"
#: In view, remembered, forgotten, never; beyond reach is left white.
_COLOURS = ("#CFE8D5", "#F7D58B", "#C9B3D9", "#C0504D")
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
    with ready_folders([folder]):
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


def coverage_figure(
    setup: Setup,
    stamps: Sequence[float],
    postures: Sequence[Array],
    volume: BlindVolume,
    *,
    title: str,
    nearest_W: Array | None = None,
) -> Figure:
    """What was in view round the arm at the end of a path: two sections, and the shares.

    Args:
        setup: robot and sensors.
        stamps: [s] ascending.
        postures: (n_q,) at these times.
        volume: of the same path.
        title: above the figure.
        nearest_W: (3,) [m] the scene's point that is truly closest; marked.
    """
    memory_s = setup.scenario.controller.memory.memory_s
    tool_W = np.asarray(setup.robot.tool_pose(postures[-1]))[:3, 3]
    figure = new_figure(12.0, 4.6, title)
    axes = figure.subplots(1, 3, width_ratios=(1.25, 1.25, 1.0))
    level = float(tool_W[2] if nearest_W is None else nearest_W[2])
    bearing = float(np.arctan2(*(tool_W if nearest_W is None else nearest_W)[1::-1]))
    along = np.array([np.cos(bearing), np.sin(bearing), 0.0])
    sections = (
        (np.eye(3)[0], np.eye(3)[1], np.array([0.0, 0.0, level]), "x [m]", "y [m]",
         f"(a) level, z = {level:.2f} m"),
        (along, np.eye(3)[2], np.zeros(3), "along the bearing [m]", "z [m]",
         f"(b) upright, bearing {np.rad2deg(bearing):.0f} deg"),
    )  # fmt: skip
    for ax, (right, up, origin, right_name, up_name, name) in zip(axes[:2], sections, strict=True):
        _section(ax, setup, stamps, postures, (right, up, origin), memory_s)
        if nearest_W is not None:
            at = nearest_W - origin
            ax.plot(at @ right, at @ up, marker="x", color="black", markersize=7, mew=1.8)
        ax.set(xlabel=right_name, ylabel=up_name)
        ax.set_title(name, loc="left", fontsize=10)
    _shares(axes[2], volume, memory_s)
    names = ("in view", f"seen within {memory_s:g} s", "seen before", "never seen")
    handles = [Patch(color=c, label=n) for c, n in zip(_COLOURS, names, strict=True)]
    handles.append(Patch(color=_ARM, label="arm"))
    if nearest_W is not None:
        handles.append(
            axes[0].plot([], [], "x", color="black", mew=1.8, label="closest point of the scene")[0]
        )
    legend_below(figure, handles)
    tidy_axes(*axes)
    for ax in axes[:2]:
        ax.locator_params(axis="x", nbins=6)
    return figure


def _section(
    ax: Axes,
    setup: Setup,
    stamps: Sequence[float],
    postures: Sequence[Array],
    plane: tuple[Array, Array, Array],
    memory_s: float,
) -> None:
    """One plane through the space round the arm: right, up and origin in world."""
    right, up, origin = plane
    robot, q = setup.robot, postures[-1]
    shadows = []
    for name, T_WL in zip(robot.link_names, np.asarray(robot.link_poses(q)), strict=True):
        vertices_L, triangles = robot.mesh(name)
        apart = placed(T_WL, vertices_L) - origin
        shadows.append(np.column_stack([apart @ right, apart @ up])[triangles])
    shadow = np.concatenate(shadows)  # (f, 3, 2)
    low = shadow.reshape(-1, 2).min(axis=0) - REACH_M
    high = shadow.reshape(-1, 2).max(axis=0) + REACH_M
    u, v = (np.arange(a, b, _STEP_M) for a, b in zip(low, high, strict=True))
    grid = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    points_W = origin + grid[:, :1] * right + grid[:, 1:] * up
    near = distances(robot, q, points_W) <= REACH_M
    kind = np.full(len(grid), np.nan)
    ages = stamps[-1] - last_seen(setup, points_W[near], stamps, postures)
    kind[near] = np.select([ages <= 1e-9, ages <= memory_s, np.isfinite(ages)], [0, 1, 2], 3)
    ax.imshow(
        kind.reshape(len(v), len(u)), origin="lower", interpolation="nearest",
        extent=(low[0], low[0] + _STEP_M * len(u), low[1], low[1] + _STEP_M * len(v)),
        cmap=ListedColormap(_COLOURS), norm=BoundaryNorm((-0.5, 0.5, 1.5, 2.5, 3.5), 4),
    )  # fmt: skip
    ax.add_collection(PolyCollection(list(shadow), facecolors=_ARM, edgecolors="none"))


def _shares(ax: Axes, volume: BlindVolume, memory_s: float) -> None:
    """The share of the volume that was not seen for so long."""
    times = np.linspace(0.0, max(2.0 * memory_s, 1.0), 81)
    shares = [100.0 * volume.share_unseen_for(time) for time in times]
    ax.step(times, shares, where="post", color="#0072B2", linewidth=1.6)
    ax.axvline(memory_s, color=GREY, linewidth=1.0, linestyle=DOTTED)
    ax.annotate(
        "memory", (memory_s, 97.0), xytext=(4, 0), textcoords="offset points", va="top", fontsize=9,
        color=GREY,
    )  # fmt: skip
    ax.set(
        ylim=(0.0, 100.0),
        xlim=(0.0, float(times[-1])),
        xlabel="not seen for more than [s]",
        ylabel=f"share of the volume within {REACH_M:g} m [%]",
    )
    ax.set_title("(c)", loc="left", fontsize=10)

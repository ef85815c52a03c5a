"""Both algorithms against what a user would take instead, in one run, on one thread.

Every contestant gets the same meshes, rays and points, and is timed only where it gives the same
answer. Each library is measured as it comes, and once more with our culling by spheres lent to it:
what of our lead is the idea, and what the rest.

    python bench/peers.py            all cells; writes docs/benchmarks.md and out/bench/peers.csv
    python bench/peers.py --quick    fewer cells, shorter; writes out/bench/ only
"""

from __future__ import annotations

import os

# One thread for all: read by the libraries when they are loaded.
os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "IGL_NUM_THREADS": "1"}

import argparse
import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from document import PATH, write_section
from numpy.typing import NDArray
from peer_libraries import MIN_HIT, Coal, Fcpw, Libigl, Open3D
from peer_loops import Spheres, closest, remove_body
from peer_tables import FOOT, HEAD, tables

from proxcgal.core.errors import ModelWarning
from proxcgal.core.progress import ProgressBar
from proxcgal.scenario.loading import load_scenario
from proxcgal.study.timing.grid import ALGORITHMS, METHODS, Effort, call_of, measure
from proxcgal.study.timing.inputs import REACH, SCENARIOS, VERTICES, Inputs, grid_inputs

PEERS = (Open3D, Fcpw, Libigl, Coal)
CULLED = " + culling"
FULL = Effort(seconds=1.0, rounds=5, most=1000)
QUICK = Effort(seconds=0.1, rounds=3, most=300)
ROOT = Path(__file__).parents[1]


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """One contestant on one input."""

    inputs: Inputs
    algorithm: int
    name: str
    wrong: str  # how its answer differs; empty where it agrees
    samples_us: NDArray[np.float64]  # empty where it does not agree


def contestants(robot: Any) -> dict[str, tuple[Any, Spheres | None]]:
    """Libraries by name, ready to be asked; those that are lent our culling at the end."""
    spheres = Spheres(robot)
    built = {peer.name: peer(robot) for peer in PEERS}
    lent = {name + CULLED: (peer, spheres) for name, peer in built.items() if name != Coal.name}
    return {name: (peer, None) for name, peer in built.items()} | lent


def results(inputs: Inputs, peers: dict[str, tuple[Any, Any]], effort: Effort) -> Iterator[Result]:
    """All contestants on one input, ours first."""
    for algorithm in ALGORITHMS:
        right = call_of(inputs, algorithm, "paper")()
        calls: dict[str, tuple[Callable[[], Any], float]] = {
            method: (call_of(inputs, algorithm, method), 1e-9) for method in METHODS
        }
        loop = remove_body if algorithm == 1 else closest
        for name, (peer, spheres) in peers.items():
            if algorithm == 2 or hasattr(peer, "first_hits"):
                calls[name] = (partial(loop, peer, inputs, spheres), peer.error)
        wrong = {
            name: difference(inputs, algorithm, right, call(), error)
            for name, (call, error) in calls.items()
        }
        agreed = {name: call for name, (call, _) in calls.items() if not wrong[name]}
        samples = measure(agreed, effort)
        for name in calls:
            yield Result(
                inputs=inputs, algorithm=algorithm, name=name, wrong=wrong[name],
                samples_us=samples.get(name, np.empty(0)),
            )  # fmt: skip


def difference(inputs: Inputs, algorithm: int, right: Any, answer: Any, error: float) -> str:
    """How an answer differs from the literal algorithm's, in words; empty where it does not."""
    if algorithm == 2:
        off = abs(getattr(answer, "distance", answer) - right.distance)
        return "" if off <= error else f"distance off by {off:.1e} m"
    wrong = np.flatnonzero(np.asarray(answer) != np.asarray(right))
    wrong = wrong[margins(inputs, wrong) > error]
    return "" if not len(wrong) else f"{len(wrong)} points differ"


def margins(inputs: Inputs, rows: NDArray[np.intp]) -> NDArray[np.float64]:
    """How far each point's nearest first hit is from deciding otherwise [m]."""
    rays_W = inputs.points_W[rows] - inputs.origins_W[rows]
    length = np.linalg.norm(rays_W, axis=1)
    directions_W = rays_W / length[:, None]
    starts_W = inputs.origins_W[rows] + MIN_HIT * directions_W
    margin = np.full(len(rows), np.inf)
    poses_W = np.asarray(inputs.robot.link_poses(inputs.q))
    for link, T_WL in zip(inputs.robot.link_names, poses_W, strict=True):
        starts_L = (starts_W - T_WL[:3, 3]) @ T_WL[:3, :3]
        hits = MIN_HIT + inputs.robot.tree(link).first_hit(starts_L, directions_W @ T_WL[:3, :3])
        margin = np.minimum(margin, np.abs(np.abs(hits - length) - inputs.tolerance[rows]))
    return margin


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="fewer cells, shorter")
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "bench", help="for peers.csv")
    parser.add_argument("--document", type=Path, default=PATH)
    options = parser.parse_args()
    warnings.simplefilter("ignore", ModelWarning)
    # Also holds those to one thread that have no setting for it.
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    vertices = (100, 1000, 10000) if options.quick else VERTICES
    clouds = ("raw", "1m") if options.quick else tuple(REACH)
    found: list[Result] = []
    count = len(SCENARIOS) * len(vertices) * len(clouds)
    with ProgressBar("measuring", [1.0] * count, "", quiet=False) as progress:
        for done, (inputs, peers) in enumerate(_prepared(vertices, clouds), 1):
            found += results(inputs, peers, QUICK if options.quick else FULL)
            progress.first(done)
            progress.finished(f"{inputs.robot.name} {inputs.vertices} {inputs.cloud}")
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "peers.csv").write_text("\n".join(_lines(found)) + "\n")
    text = tables(found, list(METHODS), CULLED)
    print(text)
    if not options.quick:
        packages = [peer.package for peer in PEERS]
        write_section("peers", f"{HEAD}\n{text}\n{FOOT}", packages, options.document)
    return 0


def _prepared(
    vertices: tuple[int, ...], clouds: tuple[str, ...]
) -> Iterator[tuple[Inputs, dict[str, tuple[Any, Any]]]]:
    for name in SCENARIOS:
        robot, peers = None, {}
        for inputs in grid_inputs(load_scenario(name), vertices, clouds):
            if inputs.robot is not robot:
                robot, peers = inputs.robot, contestants(inputs.robot)
            yield inputs, peers


def _lines(found: list[Result]) -> Iterator[str]:
    yield "robot,vertices,cloud,points,algorithm,contestant,time_us"
    for result in found:
        inputs = result.inputs
        points = inputs.points_W if result.algorithm == 1 else inputs.environment_W
        begin = f"{inputs.robot.name},{inputs.vertices},{inputs.cloud},{len(points)}"
        for time_us in result.samples_us.tolist():
            yield f"{begin},{result.algorithm},{result.name},{time_us:.3f}"


if __name__ == "__main__":
    sys.exit(main())

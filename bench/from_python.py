"""What Python adds: a tick called from here, and a robot loaded with its meshes prepared.

python bench/from_python.py out/bench: after bench_pipeline, whose ticks it is compared with.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from document import markdown_table, write_section

import proxcgal as px
from proxcgal.scenario.loading import load_scenario
from proxcgal.study.timing.inputs import SCENARIOS, Inputs, grid_inputs

VERTICES, SCANS, TICKS, LOADS = 10000, 40, 3000, 5
PERIOD, SWAY = 0.01, 0.05  # [s], [rad]: as bench_pipeline has them
HEAD = """## From Python

A tick with new scans of all 30 sensors while the arm sways, as `tick/scans` above; `px.load_robot`
at 10 000 vertices a link with its meshes in the cache. Thread CPU time of the ticks, wall time of
loading; medians.
"""


def tick_us(inputs: Inputs) -> float:
    """Median thread CPU time of a tick [us]."""
    setup = inputs.seen.setup
    controller = px.Controller(inputs.robot, setup.skin, px.ControllerConfig())
    sensors = len(setup.skin)
    batches = [inputs.seen.scans[at : at + sensors] for at in range(0, SCANS * sensors, sensors)]
    samples = []
    for tick in range(1, TICKS + 1):
        now = tick * PERIOD
        scans = [
            px.Scan(scan.sensor, tick, now, scan.ranges, scan.status)
            for scan in batches[tick % SCANS]
        ]
        q = inputs.q + SWAY * np.sin(2.0 * now + np.arange(len(inputs.q)))
        start = time.thread_time_ns()
        controller.tick(now, q, scans, setup.goal)
        samples.append((time.thread_time_ns() - start) / 1000.0)
    return float(np.median(samples))


def load_s(name: str) -> float:
    """Median wall time of loading a robot whose meshes are prepared [s]."""
    samples = []
    for _ in range(LOADS):
        start = time.perf_counter()
        px.load_robot(name, vertices_per_link=VERTICES, max_deviation=np.inf)
        samples.append(time.perf_counter() - start)
    return float(np.median(samples))


def core_us(folder: Path) -> dict[str, float]:
    """Median of the tick called from C++, by robot [us]."""
    found: list[dict[str, Any]] = json.loads((folder / "pipeline.json").read_text())["benchmarks"]
    ticks = [run for run in found if run["run_name"].startswith("tick/scans/")]
    return {run["run_name"].split("/")[2].split("_")[0]: run["median_us"] for run in ticks}


def main() -> int:
    folder = Path(sys.argv[1]) if len(sys.argv) == 2 else None
    if folder is None:
        print((__doc__ or "").strip(), file=sys.stderr)
        return 2
    core = core_us(folder)
    rows = []
    for name in SCENARIOS:
        scenario = load_scenario(name)
        for inputs in grid_inputs(scenario, [VERTICES], ["raw"], SCANS):
            robot = inputs.robot.name
            here = tick_us(inputs)
            rows.append([robot, f"{here:.1f}", f"{core[robot]:.1f}", f"{here - core[robot]:.1f}",
                         f"{load_s(scenario.robot):.2f}"])  # fmt: skip
    head = ("robot", "tick from Python us", "from C++ us", "more (budget 50)",
            "load_robot s (budget 1)")  # fmt: skip
    write_section("python", f"{HEAD}\n{markdown_table(head, rows)}")
    print(markdown_table(head, rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())

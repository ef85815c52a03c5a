"""What bench_pipeline and bench_cgal_loops measured, as tables in docs/benchmarks.md.

python bench/core_tables.py out/bench: the folder with pipeline.json and cgal_loops.csv.
"""

from __future__ import annotations

import csv
import json
import sys
from pathlib import Path
from typing import Any

from document import markdown_table, write_section

COLUMNS = {"median": "median_us", "p99": "p99_us", "p99.9": "p99.9_us", "worst": "max_us"}
HEAD = """## The core, called from C++

Thread CPU time in microseconds on the meshes and clouds of `proxcgal sweep`: 10 000 vertices a
link, raw cloud. `tick/scans` and `tick/five_tasks` get a new scan of all 30 sensors (1920 zones)
every time; `many` is the filtered cloud brought to 1, 10 and 100 times 1920 points; `inside`,
`inside_all_links` and `sphere_centre` are placed where hardly any box can be left out, and may end
with a marked lower bound.
"""
LOOPS = """### The literal form beside plain CGAL

`method="paper"` and the same loops written on CGAL with nothing of ours
(`bench/cgal_loops.cpp`), in turn; median times in microseconds, median of the ratios.
"""


def stages(found: dict[str, Any]) -> str:
    """One row a benchmark."""
    rows = []
    for run in found["benchmarks"]:
        name = run["run_name"].removesuffix("/manual_time").partition("/iterations:")[0]
        budget = run.get("budget_us")
        note = "lower bound" if run.get("lower_bound") else ""
        if "median_us" in run:
            times = [f"{run[key]:.1f}" for key in COLUMNS.values()]
            rows.append([name, *times, f"{budget:g}" if budget else "", note])
    return markdown_table(["", *COLUMNS, "budget", ""], rows)


def loading(found: dict[str, Any]) -> str:
    """Wall time of the trees."""
    rows = [
        [run["run_name"].partition("/iterations:")[0], f"{run['median_ms']:.1f}", "80"]
        for run in found["benchmarks"]
        if "median_ms" in run
    ]
    return markdown_table(["trees, built side by side", "median ms", "budget"], rows)


def loops(path: Path) -> str:
    """The stand-alone program's own table."""
    with path.open() as file:
        head, *rows = csv.reader(file)
    return markdown_table(head, rows)


def main() -> int:
    folder = Path(sys.argv[1]) if len(sys.argv) == 2 else None
    if folder is None:
        print((__doc__ or "").strip(), file=sys.stderr)
        return 2
    found = json.loads((folder / "pipeline.json").read_text())
    parts = [HEAD, stages(found), "", loading(found), "", LOOPS, loops(folder / "cgal_loops.csv")]
    write_section("core", "\n".join(parts))
    return 0


if __name__ == "__main__":
    sys.exit(main())

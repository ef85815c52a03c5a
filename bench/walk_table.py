"""What bench_walkthrough measured, as a section of docs/benchmarks.md.

python bench/walk_table.py out/bench: the folder with walkthrough.json.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from core_tables import stages
from document import write_section

HEAD = """## A cycle of walk-through programming

Thread CPU time in microseconds, 200 000 cycles on a wandering six-joint arm: the guard with seven
capsules, all of them monitored (kinematics, distances, velocities, both logics), and hand guiding
(admittance, solver, limits). Reading the thread's clock is about a third of a microsecond of each.
"""


def main() -> int:
    found = json.loads((Path(sys.argv[1]) / "walkthrough.json").read_text())
    write_section("walkthrough", f"{HEAD}\n{stages(found)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""What the monitor's checks cost a tick, as a share of its instructions.

    python bench/monitor_share.py BINARY [TICKS]     BINARY: build/bench/bench_guard

Callgrind counts what each function takes with all that it calls, while a tick is running; the
checks are those functions that a tick would not call without them. What the compiler put into the
tick itself (copying a record of 600 bytes, comparing residuals) cannot be told apart and is not
counted.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

#: Each is called by the tick or by perception; none by another of them but `Monitor::add`.
CHECKS = (
    "Freshness::accept", "Freshness::note", "Freshness::check", "Caution::trust_sensed",
    "Caution::slow_into_unseen", "Caution::keep_off", "Caution::watch", "Monitor::begin",
    "Monitor::deadline", "Monitor::conclude",
)  # fmt: skip
TICK = "proxcgal::Controller::tick(*"
BOUND = 0.10


def profile(binary: Path, ticks: int) -> list[tuple[int, str]]:
    """Inclusive instructions and name of every function, in ticks only."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "callgrind.out"
        subprocess.run(
            ["valgrind", "--tool=callgrind", f"--toggle-collect={TICK}",
             f"--callgrind-out-file={out}", str(binary), str(ticks)],
            env={**os.environ, "PROXCGAL_KERNELS": "portable"}, capture_output=True, check=True,
        )  # fmt: skip
        told = subprocess.run(
            ["callgrind_annotate", "--inclusive=yes", "--threshold=100", str(out)],
            capture_output=True, text=True, check=True,
        ).stdout  # fmt: skip
    lines = re.findall(r"^\s*([\d,]+)(?: \([\d. ]+%\))?\s+(.+)$", told, re.MULTILINE)
    return [(int(count.replace(",", "")), name) for count, name in lines]


def main() -> int:
    """Prints the share of each check and of all; fails above the bound."""
    binary = Path(sys.argv[1])
    ticks = int(sys.argv[2]) if len(sys.argv) > 2 else 100
    functions = profile(binary, ticks)
    total = max(count for count, name in functions if "PROGRAM TOTALS" in name)
    found = {
        check: max((n for n, name in functions if f"{check}(" in name), default=0)
        for check in CHECKS
    }
    for check, count in found.items():
        print(f"{check:28} {count / ticks:12.0f} instructions a tick  {count / total:7.3%}")
    checks = sum(found.values())
    more = checks / (total - checks)
    print(f"tick {total / ticks:.0f} instructions; the monitor's checks are {more:.2%} more")
    return int(more > BOUND)


if __name__ == "__main__":
    sys.exit(main())

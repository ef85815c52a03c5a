"""Counts the instructions of one tick on a fixed input, and holds them against what was kept.

    python bench/guard.py BINARY                       compare with bench/guard.json
    python bench/guard.py BINARY --refresh "REASON"    keep the new count, and why it changed

Instructions are counted by callgrind, on the portable kernels: the same on any machine that has
this compiler, however busy it is. Another compiler's count is told, and held against nothing.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
from pathlib import Path

KEPT = Path(__file__).with_name("guard.json")
FEW, MANY = 20, 120  # ticks: the difference leaves set-up and the first tick out


def count(binary: Path, ticks: int) -> int:
    """Instructions of the whole program."""
    command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", str(binary)]
    run = subprocess.run(
        [*command, str(ticks)],
        env={**os.environ, "PROXCGAL_KERNELS": "portable"},
        capture_output=True,
        text=True,
        check=True,
    )
    found = re.search(r"Collected : (\d+)", run.stderr)
    if found is None:
        raise SystemExit(f"guard: valgrind told no count:\n{run.stderr}")
    return int(found[1])


def compiler() -> str:
    """Name and version of what `cc` compiles with; other versions make other code."""
    told = subprocess.run(["c++", "--version"], capture_output=True, text=True, check=True)
    return told.stdout.splitlines()[0]


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("binary", type=Path)
    parser.add_argument("--refresh", metavar="REASON", help="keep the new count")
    options = parser.parse_args()
    per_tick = round((count(options.binary, MANY) - count(options.binary, FEW)) / (MANY - FEW))
    kept = json.loads(KEPT.read_text()) if KEPT.exists() else {"allowed_drift": 0.05, "counts": {}}
    name = compiler()
    before = kept["counts"].get(name)
    if options.refresh:
        kept["counts"][name] = {"instructions_per_tick": per_tick, "reason": options.refresh}
        KEPT.write_text(json.dumps(kept, indent=2) + "\n")
        print(f"guard: {per_tick} instructions a tick, kept in {KEPT.name}")
        return 0
    if before is None:
        print(f"guard: {per_tick} instructions a tick; none is kept for {name}")
        return 0
    drift = per_tick / before["instructions_per_tick"] - 1.0
    print(
        f"guard: {per_tick} instructions a tick, {drift:+.1%} against "
        f"{before['instructions_per_tick']} (allowed: {kept['allowed_drift']:.0%} more)"
    )
    if drift > kept["allowed_drift"]:
        print("guard: the tick has become slower. Mend it, or keep the new count with its reason:")
        print('  ./run bench --guard --refresh "REASON"')
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())

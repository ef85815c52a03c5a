"""Runs one Python fuzz target under atheris: python fuzz/drive.py TARGET [libFuzzer's arguments].

Alone with the name of a file it runs that input once: so a crash is seen again.
"""

from __future__ import annotations

import importlib
import os
import sys

import atheris

TARGETS = ("urdf", "xacro_file", "scenario", "recording", "mesh_file")
# Counting which code an input reaches makes everything slower.
os.environ.setdefault("PROXCGAL_FUZZ_ALLOWANCE", "5")


def main() -> None:
    """Hands the target's bytes over, until libFuzzer's arguments say that it is enough."""
    if len(sys.argv) < 2 or sys.argv[1] not in TARGETS:
        sys.exit(f"drive.py: the first argument is one of {', '.join(TARGETS)}")
    name = sys.argv.pop(1)
    with atheris.instrument_imports(include=["proxcgal", "mcap", "tomllib"]):
        target = importlib.import_module(name)
    atheris.Setup(sys.argv, target.once)
    atheris.Fuzz()


if __name__ == "__main__":
    main()

"""The script `run`: a slip on its command line is told at once, before anything is set up."""

import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def run(*arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [ROOT / "run", *arguments], capture_output=True, text=True, check=False, timeout=60
    )


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["stup"], "unknown command 'stup'"),
        (["setup", "--rso"], "setup: '--rso' is not known"),
        (["setup", "--ros", "now"], "setup: 'now' is not known"),
        (["lint", "--fx"], "lint: '--fx' is not known"),
        (["check", "--tsan", "--shrt"], "check: '--shrt' is not known"),
        (["check", "--asan", "--short", "x"], "check: 'x' is not known"),
        (["bench", "--quik"], "bench: '--quik' is not known"),
        (["bench", "--quick", "x"], "bench: 'x' is not known"),
        (["fuzz"], "fuzz: how many minutes?"),
        (["fuzz", "ten"], "fuzz: how many minutes?"),
        (["fuzz", "1", "tik"], "fuzz: no target 'tik'; there are tick mesh urdf"),
    ],
)
def test_a_slip_is_told_and_nothing_is_done(arguments: list[str], told: str) -> None:
    done = run(*arguments)
    assert done.returncode == 2
    assert told in done.stderr
    assert done.stdout == ""
    assert "..." not in done.stderr  # no step was begun


def test_help_is_no_error_and_names_every_command() -> None:
    for word in ("help", "-h", "--help"):
        done = run(word)
        assert done.returncode == 0
        named = {line.split()[0] for line in done.stdout.splitlines() if line[2:3].strip()}
        assert {"setup", "demo", "test", "bench", "lint", "check", "fuzz", "help"} <= named

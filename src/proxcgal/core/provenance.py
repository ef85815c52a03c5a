"""Where results come from: versions, commit, machine, the command that made them."""

from __future__ import annotations

import os
import platform
import subprocess
import tomllib
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from proxcgal.core.versions import versions


def origin(command: str) -> dict[str, Any]:
    """What `run.json` says of how its results were made: plain JSON values."""
    return {
        "command": command,
        "made": datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S UTC"),
        "commit": commit(Path.cwd()),
        "machine": machine(),
        "versions": versions(),
    }


def machine() -> str:
    """The processor, how many there are, and the system: what a time depends on."""
    try:
        told = Path("/proc/cpuinfo").read_text(errors="replace")
    except OSError:
        told = ""
    models = [line.partition(":")[2].strip() for line in told.splitlines() if "model name" in line]
    processor = f"{models[0]} ({platform.machine()})" if models else platform.machine()
    return f"{processor}, {os.cpu_count()} processors, {platform.system()}"


def commit(folder: Path) -> str | None:
    """The commit of the proxcgal checkout that `folder` lies in, with `+` where files differ.

    None in any other folder: another project's commit says nothing about these results.
    """
    top = _git(folder, "rev-parse", "--show-toplevel")
    if not top:
        return None
    project = Path(top) / "pyproject.toml"
    try:
        name = tomllib.loads(project.read_text()).get("project", {}).get("name")
    except (OSError, ValueError):
        return None
    head = _git(folder, "rev-parse", "--short=12", "HEAD")
    if name != "proxcgal" or not head:
        return None
    return head + ("+" if _git(folder, "status", "--porcelain", "--untracked-files=no") else "")


def _git(folder: Path, *arguments: str) -> str:
    try:
        done = subprocess.run(
            ("git", "-C", str(folder), *arguments),
            capture_output=True,
            text=True,
            timeout=10,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""

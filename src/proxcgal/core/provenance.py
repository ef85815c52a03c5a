"""Where results come from: versions and files of this build, commit, machine, command."""

import functools
import hashlib
import importlib.metadata
import json
import os
import platform
import subprocess
import tomllib
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from proxcgal import _core

PACKAGES = ("proxcgal", "numpy", "mujoco", "pin", "trimesh")
_DIGITS = 16  # of a digest: enough to tell builds apart, short enough to read


def origin(command: str) -> dict[str, Any]:
    """What `run.json` says of how its results were made: plain JSON values."""
    return {
        "command": command,
        "made": datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S UTC"),
        "commit": commit(Path.cwd()),
        "machine": machine(),
        "versions": versions(),
    }


def versions() -> dict[str, str]:
    """Versions of the packages that can change a result, of this build, Python and processor."""
    found = {}
    for name in PACKAGES:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = "not installed as a package"
    found |= {"build": build(), "python": platform.python_version(), "machine": platform.machine()}
    commit = _installed_commit()
    return found | ({"commit": commit} if commit else {})


@functools.cache
def build() -> str:
    """SHA-256 of the package's files, Python and compiled, as this process first found them.

    An installation in place keeps its version while its files change.
    """
    package = Path(__file__).parents[1]
    files = [
        Path(folder) / name
        for folder, _, names in os.walk(package, followlinks=True)
        for name in names
        if name.endswith(".py")
    ]
    digest = hashlib.sha256()
    for file in [*sorted(files), Path(_core.__file__)]:
        content = file.read_bytes()
        name = file.relative_to(package).as_posix() if file in files else "_core"
        digest.update(f"{name} {len(content)}\n".encode())
        digest.update(content)
    return digest.hexdigest()[:_DIGITS]


def _installed_commit() -> str | None:
    """Where pip installed from a repository: what was checked out there."""
    try:
        source = importlib.metadata.distribution("proxcgal").read_text("direct_url.json")
    except importlib.metadata.PackageNotFoundError:
        return None
    commit: str | None = json.loads(source or "{}").get("vcs_info", {}).get("commit_id")
    return commit


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

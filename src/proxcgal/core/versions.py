"""What a result depends on beside the scenario: versions, and the very files of this build."""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import json
import os
import platform
from pathlib import Path

from proxcgal import _core

PACKAGES = ("proxcgal", "numpy", "mujoco", "pin", "trimesh")
_DIGITS = 16  # of a digest: enough to tell builds apart, short enough to read


def versions() -> dict[str, str]:
    """Versions of the packages that can change a result, of this build, Python and processor."""
    found = {}
    for name in PACKAGES:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = "not installed as a package"
    found |= {"build": build(), "python": platform.python_version(), "machine": platform.machine()}
    commit = _commit()
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


def _commit() -> str | None:
    """Where pip installed from a repository: what was checked out there."""
    try:
        source = importlib.metadata.distribution("proxcgal").read_text("direct_url.json")
    except importlib.metadata.PackageNotFoundError:
        return None
    commit: str | None = json.loads(source or "{}").get("vcs_info", {}).get("commit_id")
    return commit

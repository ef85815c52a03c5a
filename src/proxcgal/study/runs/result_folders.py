"""Folders of results: made, shown to be writable, cleared of an earlier run's files."""

import contextlib
import tempfile
from collections.abc import Sequence
from pathlib import Path

from proxcgal.core.errors import ConfigError
from proxcgal.scenario.scenario import CONTROLLERS
from proxcgal.study.campaign_store import MANIFEST

#: What a run writes. Older ones are removed before a run begins: an interrupted run must not leave
#: its recordings beside another run's numbers.
FILES = (
    "summary.json", "run.json", "scenario.toml", "report.html", "distance.png", "pairs.png",
    "motion.gif", "motion.png", *(f"{controller}.mcap" for controller in CONTROLLERS),
)  # fmt: skip


def ready_folders(folders: Sequence[Path]) -> list[Path]:
    """Makes the folders, shows that they can be written, removes an earlier run's files.

    Returns:
        The folders that were not there before, innermost last.

    Raises:
        ConfigError: a folder cannot be made or written, or holds a campaign; none is left behind
            that was not there.
    """
    for folder in folders:
        if (folder / MANIFEST).exists():
            raise ConfigError(
                f"--out {folder}: holds a campaign; name another folder, or remove it"
            )
    made: list[Path] = []
    try:
        for folder in folders:
            missing = [p for p in (folder, *folder.parents) if not p.exists()]
            for path in reversed(missing):
                path.mkdir()
                made.append(path)
            with tempfile.TemporaryFile(dir=folder) as probe:
                probe.write(b"proxcgal")
    except OSError as error:
        remove_empty(made)
        raise ConfigError(f"--out {folder}: cannot be written: {error.strerror or error}") from None
    for folder in folders:
        for name in FILES:
            (folder / name).unlink(missing_ok=True)
    return made


def remove_empty(folders: Sequence[Path]) -> None:
    """Removes those of the folders, innermost last, that nothing was written to."""
    for path in reversed(folders):
        with contextlib.suppress(OSError):
            path.rmdir()

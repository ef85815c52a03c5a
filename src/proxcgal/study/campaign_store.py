"""A campaign's folder: every finished trial at once, whole or not at all, and found again."""

import contextlib
import fcntl
import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from proxcgal.core.closing import Closing
from proxcgal.core.errors import ConfigError
from proxcgal.core.files import write_json

MANIFEST, TRIALS, SUMMARY = "campaign.json", "trials", "summary.json"

Value = str | int | float | bool | None
Series = list[float | None]  # a number over time
Row = dict[str, Value | Series]


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """Result of one trial."""

    key: str
    row: Row | None = None  # its numbers; None where it failed
    error: str | None = None  # why it failed
    wall_s: float = 0.0  # [s] what it took; says nothing of the trial itself


class CampaignStore(Closing):
    """The trials of one campaign that came to an end, one file each.

    A file is written beside, brought to the disk and moved into place before `put` returns: what
    is there is whole, whatever ended the process or the machine.
    """

    def __init__(self, folder: Path, description: Mapping[str, Any]) -> None:
        """Opens the folder for this process alone, or makes it.

        Args:
            folder: of this campaign and no other.
            description: what makes it this campaign, as plain JSON values.

        Raises:
            ConfigError: the folder holds another campaign or other results, another process works
                in it, or it cannot be written.
        """
        self._trials = folder / TRIALS
        self._held = contextlib.ExitStack()
        with contextlib.ExitStack() as opened:
            try:
                folder.mkdir(parents=True, exist_ok=True)
                handle = os.open(folder, os.O_RDONLY)
                opened.callback(os.close, handle)
                _lock(handle, folder)
                self._open(folder, description)
            except OSError as error:
                raise ConfigError(
                    f"--out {folder}: cannot be written: {error.strerror or error}"
                ) from None
            self._held = opened.pop_all()

    def _open(self, folder: Path, description: Mapping[str, Any]) -> None:
        """Checks and prepares the folder, which is locked."""
        _refuse_other(folder, description)
        self._trials.mkdir(exist_ok=True)
        for half in self._trials.glob(".*"):  # of a process that was killed
            half.unlink()
        if not (folder / MANIFEST).is_file():
            write_json(folder / MANIFEST, description)

    def close(self) -> None:
        """Unlocks the folder, the first time; the end of the process does so too."""
        self._held.close()

    def put(self, outcome: Outcome) -> None:
        """Once this returns, the outcome is found again after anything but a broken disk."""
        write_json(self._trials / f"{outcome.key}.json", asdict(outcome))

    def outcomes(self, keys: Iterable[str]) -> dict[str, Outcome]:
        """Those of these trials that are there, by key; what cannot be read counts as not there."""
        found = {}
        for key in keys:
            with contextlib.suppress(OSError, ValueError, TypeError):
                found[key] = Outcome(**json.loads((self._trials / f"{key}.json").read_bytes()))
        return found


def _read_manifest(folder: Path) -> dict[str, Any] | None:
    """Description of the campaign in a folder; None where there is none.

    Raises:
        ConfigError: there is something that cannot be read.
    """
    path = folder / MANIFEST
    try:
        content = json.loads(path.read_bytes())
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from None
    if not isinstance(content, dict):
        raise ConfigError(f"{path}: must hold a JSON object")
    return content


def _refuse_other(folder: Path, description: Mapping[str, Any]) -> None:
    there = _read_manifest(folder)
    here = json.loads(json.dumps(description))
    if there is None and (folder / SUMMARY).exists():
        raise ConfigError(
            f"--out {folder}: holds results of something else ({SUMMARY} without {MANIFEST}); "
            "name another folder, or remove that one"
        )
    if there is None or there == here:
        return
    lines = [
        f"--out {folder}: holds another campaign: {key} is {_shown(there.get(key))} there and "
        f"{_shown(here.get(key))} here; name another folder, or remove that one"
        for key in sorted(there.keys() | here.keys())
        if there.get(key) != here.get(key)
    ]
    raise ConfigError("\n".join(lines))


def _shown(value: Any) -> str:
    return "not told" if value is None else json.dumps(value)


def _lock(handle: int, folder: Path) -> None:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise ConfigError(f"--out {folder}: another process is at work on this campaign") from None
    except OSError:
        pass  # a file system without locks

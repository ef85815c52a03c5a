"""A campaign's folder: every finished trial at once, whole or not at all, and found again."""

import contextlib
import fcntl
import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from proxcgal.core.closing import Closing
from proxcgal.core.errors import ConfigError
from proxcgal.core.files import as_json, write_json

_SUM = "sha256"  # of the rest of a trial's file
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
                hold(folder, opened, "campaign")
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
        content = json.loads(as_json(asdict(outcome)))
        write_json(self._trials / f"{outcome.key}.json", {**content, _SUM: _checksum(content)})

    def outcomes(self, keys: Iterable[str]) -> dict[str, Outcome]:
        """Those of these trials that are there, by key; a file that is cut off counts as not there.

        Raises:
            ConfigError: a file that is whole and not as `put` wrote it: names it.
        """
        found = {}
        for key in keys:
            path = self._trials / f"{key}.json"
            try:
                content = json.loads(path.read_bytes())
            except RecursionError:
                raise _not_a_trial(path, "is nested too deep") from None
            except (FileNotFoundError, ValueError):  # half of it
                continue
            except OSError as error:
                raise _not_a_trial(path, f"cannot be read: {error.strerror}") from None
            found[key] = _outcome(content, key, path)
        return found


def _outcome(content: Any, key: str, path: Path) -> Outcome:
    """What a trial's file holds. Raises: ConfigError: it is not as it was written."""
    names = {field.name for field in fields(Outcome)}
    if not isinstance(content, dict) or content.keys() - {_SUM} != names:
        raise _not_a_trial(path, f"must hold {', '.join(sorted(names))}")
    if content["key"] != key:
        raise _not_a_trial(path, f"is of trial {json.dumps(content['key'])[:80]}")
    error, row, wall_s = content["error"], content["row"], content["wall_s"]
    if not isinstance(wall_s, int | float) or isinstance(wall_s, bool):
        raise _not_a_trial(path, f"wall_s is {json.dumps(wall_s)[:80]}; a number is needed")
    if not (error is None or isinstance(error, str)):
        raise _not_a_trial(path, f"error is {json.dumps(error)[:80]}; text or null is needed")
    if not (row is None or isinstance(row, dict)):
        raise _not_a_trial(path, f"row is {json.dumps(row)[:80]}; an object or null is needed")
    for name, value in (row or {}).items():
        if not _is_value(value):
            raise _not_a_trial(path, f"{name} is {json.dumps(value)[:80]}; text, a number, true, "
                               "false, null or a list of numbers is needed")  # fmt: skip
    own = {name: value for name, value in content.items() if name != _SUM}
    if content.get(_SUM) != _checksum(own):
        raise _not_a_trial(path, "is not as it was written: its checksum is another")
    return Outcome(**own)


def _is_value(value: Any) -> bool:
    if isinstance(value, list):
        return all(
            item is None or (isinstance(item, int | float) and not isinstance(item, bool))
            for item in value
        )
    return value is None or isinstance(value, str | int | float)


def _not_a_trial(path: Path, what: str) -> ConfigError:
    return ConfigError(f"{path}: {what}; remove the file, and that trial is run again")


def _checksum(content: Mapping[str, Any]) -> str:
    """SHA-256 of JSON values, whatever the order of their keys."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


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
    except (OSError, ValueError, RecursionError) as error:
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


def hold(folder: Path, opened: contextlib.ExitStack, what: str = "folder") -> None:
    """Locks a folder for this process alone, until `opened` is closed or the process ends.

    Raises:
        ConfigError: another run is at work on it.
        OSError: it cannot be opened.
    """
    handle = os.open(folder, os.O_RDONLY)
    opened.callback(os.close, handle)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise ConfigError(f"--out {folder}: another process is at work on this {what}") from None
    except OSError:
        pass  # a file system without locks

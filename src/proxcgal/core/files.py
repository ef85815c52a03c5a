"""Files that are whole or not there, and strict JSON."""

import json
import math
import os
import tempfile
from collections.abc import Mapping
from numbers import Integral
from pathlib import Path
from typing import Any

NOTHING_M = 9.99  #: [m] how a distance to nothing is written


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Strict JSON (no NaN), whole or not at all: written beside and moved into place.

    Raises: as `as_json`.
    """
    write_bytes(path, as_json(content))


def as_json(content: Mapping[str, Any]) -> bytes:
    """Strict JSON (no NaN), as a file's bytes.

    Raises:
        ValueError: a number that is not finite, which JSON cannot hold.
    """
    text = json.dumps(content, indent=2, allow_nan=False, default=_plain)
    return (text + "\n").encode()


def write_text(path: Path, text: str) -> None:
    """A file that is whole or not there: readers never meet half of it."""
    write_bytes(path, text.encode())


def write_bytes(path: Path, content: bytes) -> None:
    """A file that is whole or not there, and on the disk once this returns.

    Raises:
        OSError: it cannot be written; with its name, where the disk is full too.
    """
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    except OSError as error:
        error.filename = str(path)
        raise
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(name).chmod(0o644)  # mkstemp makes it private
        Path(name).replace(path)
    except BaseException as error:
        Path(name).unlink(missing_ok=True)
        if isinstance(error, OSError):
            error.filename = str(path)
        raise
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)  # the name too
    finally:
        os.close(folder)


def finite(value: Any) -> float | int | None:
    """A finite plain number: None for NaN, 9.99 for a distance to nothing."""
    if value is None:
        return None
    if isinstance(value, Integral):
        return int(value)
    number = float(value)
    if math.isnan(number):
        return None
    return NOTHING_M if math.isinf(number) else number


def _plain(value: Any) -> Any:
    """NumPy numbers and arrays as JSON has them."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no form in JSON")

"""What every Python fuzz target promises: errors of our own only, in bounded time and memory."""

from __future__ import annotations

import os
import resource
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from proxcgal.core.errors import ModelWarning, ProxError

# Of one call, imports apart: docs/reliability.md for a URDF, and enough for the others.
SECONDS = 1.0
MEGABYTES = 256
# Coverage counters and a slow machine are no fault of what is tested.
_ALLOWANCE = float(os.environ.get("PROXCGAL_FUZZ_ALLOWANCE", "1"))


class ViolationError(Exception):
    """A promise that an input broke."""


@contextmanager
def promises() -> Iterator[None]:
    """Lets errors of ours pass; whatever else comes out is what the fuzzer looks for.

    Raises:
        ViolationError: the call took too much processor time or memory.
        Exception: any error that is no ProxError, or a warning that is not documented.
    """
    start, peak = time.process_time(), _peak_megabytes()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", ModelWarning)
        try:
            yield
        except ProxError as error:
            if not str(error).strip():
                raise ViolationError(f"{type(error).__name__} without a message") from error
    if (took := time.process_time() - start) > SECONDS * _ALLOWANCE:
        raise ViolationError(f"took {took:.2f} s of processor time, {SECONDS} s are allowed")
    if (grew := _peak_megabytes() - peak) > MEGABYTES:
        raise ViolationError(f"took {grew:.0f} MB, {MEGABYTES} MB are allowed")


def _peak_megabytes() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024

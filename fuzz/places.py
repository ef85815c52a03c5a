"""Where a fuzz target puts the file that it has the product read."""

from __future__ import annotations

import atexit
import functools
import os
import shutil
import tempfile
from pathlib import Path

# What was read is not kept: every input is read in full.
os.environ["XDG_CACHE_HOME"] = os.devnull


@functools.cache
def folder() -> Path:
    """A folder of this process, in memory where there is such a place; removed at the end."""
    memory = Path("/dev/shm")
    made = tempfile.mkdtemp(prefix="proxcgal-fuzz-", dir=memory if memory.is_dir() else None)
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    return Path(made)

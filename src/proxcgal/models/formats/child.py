"""Work on files that may be broken or hostile, in a process of its own with limits.

A crash, endless work or too much memory there is an error message here.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from proxcgal.core.errors import ModelError

MAX_SECONDS = 10.0  # of processor time
MAX_MEMORY = 2**30  # [bytes]
# Waits for a processor are no fault of the file.
_MOST_WAIT = 60.0
# Limits first, then the script, whose own folder stays out of the search path (-P). Of memory what
# is private and writable counts: libraries map far more address space than they use.
_START = """
import resource, runpy, sys
seconds, memory = int(sys.argv[2]), int(sys.argv[3])
resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
runpy.run_path(sys.argv[1], run_name="__main__")
"""
_ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MUJOCO_GL": "disable"}


def run_limited(
    script: Path, request: Mapping[str, Any], path: Path
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """What a script makes of a request.

    The script reads `request.json` in its working folder, an empty one, and writes `reply.json`
    and, where it has arrays, `reply.npz`. A reply with `error` is raised.

    Args:
        script: a Python file that imports nothing of this package.
        request: a JSON object.
        path: the file concerned, for messages.

    Raises:
        ModelError: the script's error, or that it crashed or went past a limit.
    """
    with tempfile.TemporaryDirectory(prefix="proxcgal-") as name:
        folder = Path(name)
        (folder / "request.json").write_text(json.dumps(request))
        command = [sys.executable, "-P", "-c", _START, str(script), str(int(MAX_SECONDS)),
                   str(MAX_MEMORY)]  # fmt: skip
        try:
            done = subprocess.run(
                command, cwd=folder, env={**os.environ, **_ONE_THREAD}, stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=_MOST_WAIT, check=False,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            raise ModelError(f"{path}: reading it takes more than {_MOST_WAIT:g} s") from None
        except OSError as error:
            raise ModelError(f"{path}: no process to read it: {error}") from None
        try:
            reply = json.loads((folder / "reply.json").read_text())
            arrays = {}
            if (folder / "reply.npz").is_file():
                with np.load(folder / "reply.npz", allow_pickle=False) as file:
                    arrays = {key: file[key] for key in file.files}
        except (OSError, ValueError):
            raise ModelError(f"{path}: {_failure(done)}") from None
    if "error" in reply:
        raise ModelError(f"{path}: {reply['error']}")
    return reply, arrays


def _failure(done: "subprocess.CompletedProcess[bytes]") -> str:
    last = done.stdout.decode(errors="replace").strip().splitlines()[-1:]
    said = last[0][:200] if last else "no word"
    if done.returncode in (-9, -24):  # SIGKILL, SIGXCPU
        return f"reading it takes more than {MAX_SECONDS:g} s of processor time"
    if "MemoryError" in said or "bad_alloc" in said or "allocate memory" in said:
        return f"reading it takes more than {MAX_MEMORY // 2**20} MiB of memory"
    return f"its reader ended with status {done.returncode}: {said}"

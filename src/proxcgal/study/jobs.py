"""Messages between a job and its master process: the share done, and the request to stop."""

import functools
import os
import signal
import threading
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any

import numpy as np

ShareReport = Callable[[float], None]  # called by a job with its share done, 0 to 1
Job = Callable[[ShareReport], Any]  # picklable; does the work

WATCH_S = 1.0  # [s] between looks at whether the master is alive
_STOP_SLOT = 0


class StoppedError(Exception):
    """Raised inside a job that has to stop."""


class SharedProgress:
    """Shares of all jobs done, and the request to stop, in a file that every process maps.

    A mapped file needs no server process and no queue, and costs a job nothing.
    """

    def __init__(self, path: Path, jobs: int) -> None:
        """Maps the file, made here where it is not there."""
        if not path.exists():
            np.zeros(jobs + 1).tofile(path)
        self._shares = np.memmap(path, dtype=np.float64, mode="r+")

    def report(self, job: int, share: float) -> None:
        """Notes the share done; raises `StoppedError` where the run is to end."""
        self.note(job, share)
        if self._shares[_STOP_SLOT]:
            raise StoppedError

    def note(self, job: int, share: float) -> None:
        """Notes the share done; never raises."""
        self._shares[1 + job] = share

    def stop(self) -> None:
        """Requests all jobs to stop at their next report."""
        self._shares[_STOP_SLOT] = 1.0

    def shares(self) -> list[float]:
        """Share done of every job, in their order."""
        return [float(share) for share in self._shares[1:]]


def work(job: Job, path: str, row: int) -> Any:
    """One job in a worker process."""
    report = functools.partial(SharedProgress(Path(path), 0).report, row)
    report(0.0)
    return job(report)


def end_with(master: int) -> None:
    """Ends this worker process soon after its master, which may have been killed."""

    def watch() -> None:
        while os.getppid() == master:
            clock.sleep(WATCH_S)
        os._exit(1)  # busy or not: no process is left to take a result

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def interrupts_blocked() -> Iterator[None]:
    """No Ctrl-C for this thread, and for the processes that it starts, for good."""
    resource_tracker.ensure_running()  # starting it unblocks Ctrl-C in some Pythons
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)

"""Trials side by side: worker processes with progress, that end cleanly when told to."""

from __future__ import annotations

import os
import signal
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from proxcgal.errors import SimulationError

Report = Callable[[float], None]  # called by a job with its share done, 0 to 1
Job = Callable[[Report], Any]  # picklable; does the work

POLL_S = 0.1  # [s] between looks at the progress
_STOP_SLOT = 0


class StoppedError(Exception):
    """Raised inside a job that was told to stop."""


class Progress:
    """Shares of all jobs done, and the word to stop, in a file that every process maps.

    A mapped file needs no server process and no queue, and costs a job nothing.
    """

    def __init__(self, path: Path, jobs: int) -> None:
        """Maps the file, made here where it is not there."""
        if not path.exists():
            np.zeros(jobs + 1).tofile(path)
        self._shares = np.memmap(path, dtype=np.float64, mode="r+")

    def report(self, job: int, share: float) -> None:
        """Notes the share done; raises `StoppedError` where the run is to end."""
        self._shares[1 + job] = share
        if self._shares[_STOP_SLOT]:
            raise StoppedError

    def stop(self) -> None:
        """Tells all jobs to stop at their next report."""
        self._shares[_STOP_SLOT] = 1.0

    def shares(self) -> list[float]:
        """Share done of every job, in their order."""
        return [float(share) for share in self._shares[1:]]


class Pool:
    """Runs jobs on worker processes, or here when one worker is enough.

    Ctrl-C reaches this process only: workers have it blocked, are told through the progress file,
    close what they write, and are waited for.
    """

    def __init__(self, workers: int) -> None:
        """A pool of that many processes, which start with the first job."""
        self._executor: ProcessPoolExecutor | None = None
        if workers > 1:
            self._executor = ProcessPoolExecutor(workers, mp_context=get_context("spawn"))

    def __enter__(self) -> Self:
        """The pool itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Waits for the workers to end."""
        if self._executor is not None:
            self._executor.shutdown(wait=True, cancel_futures=True)

    def run(
        self,
        jobs: Sequence[Job],
        on_progress: Callable[[list[float]], None] | None = None,
        on_done: Callable[[int, Any], None] | None = None,
    ) -> list[Any]:
        """All jobs' results, in the jobs' order.

        Args:
            jobs: each is called with a function that takes its share done.
            on_progress: called with all jobs' shares, now and then.
            on_done: called with a job's row and result, as each ends.

        Raises:
            SimulationError: a worker process died (killed, or out of memory).
            Exception: the first that a job raised; the others are stopped.
        """
        with tempfile.TemporaryDirectory(prefix="proxcgal-") as folder:
            path = Path(folder) / "progress"
            progress = Progress(path, len(jobs))
            tell = on_progress or (lambda _: None)
            done = on_done or (lambda *_: None)
            if self._executor is None:
                return self._run_here(jobs, progress, tell, done)
            return self._run_there(self._executor, jobs, path, progress, tell, done)

    @staticmethod
    def _run_here(
        jobs: Sequence[Job],
        progress: Progress,
        tell: Callable[[list[float]], None],
        done: Callable[[int, Any], None],
    ) -> list[Any]:
        results = []
        for row, job in enumerate(jobs):

            def report(share: float, row: int = row) -> None:
                progress.report(row, share)
                tell(progress.shares())

            results.append(job(report))
            report(1.0)
            done(row, results[-1])
        return results

    @staticmethod
    def _run_there(
        executor: ProcessPoolExecutor,
        jobs: Sequence[Job],
        path: Path,
        progress: Progress,
        tell: Callable[[list[float]], None],
        done: Callable[[int, Any], None],
    ) -> list[Any]:
        rows: dict[Future[Any], int] = {}
        results: list[Any] = [None] * len(jobs)
        try:
            with _interrupts_blocked():  # workers inherit it
                for row, job in enumerate(jobs):
                    rows[executor.submit(_work, job, str(path), row, len(jobs))] = row
            waiting = set(rows)
            while waiting:
                ended, waiting = wait(waiting, timeout=POLL_S)
                tell(progress.shares())
                for future in ended:
                    results[rows[future]] = future.result()
                    done(rows[future], results[rows[future]])
        except BrokenProcessPool:
            raise SimulationError(
                "a worker process died (killed, or out of memory); --workers 1 needs least memory"
            ) from None
        except BaseException:
            progress.stop()
            for future in rows:
                future.cancel()
            wait(rows)
            raise
        return results


def _work(job: Job, path: str, row: int, jobs: int) -> Any:
    """One job in a worker process."""
    progress = Progress(Path(path), jobs)

    def report(share: float) -> None:
        progress.report(row, share)

    report(0.0)
    result = job(report)
    report(1.0)
    return result


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """No Ctrl-C for this thread, and for the processes that it starts, for good."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def default_workers(jobs: int) -> int:
    """As many as there are jobs, at most one a processor that this process may use."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return max(1, min(jobs, usable or 1))

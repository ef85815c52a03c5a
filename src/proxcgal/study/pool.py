"""Jobs side by side: worker processes with progress, that end cleanly when told to, or a cluster.

Local workers are joblib's (loky), which come to life again when one was killed.
"""

from __future__ import annotations

import os
import tempfile
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    ALL_COMPLETED,
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    wait,
)
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from proxcgal.errors import SimulationError
from proxcgal.study.cluster import Cluster, work_far
from proxcgal.study.jobs import Job, Progress, end_with, interrupts_blocked, work

POLL_S = 0.1  # [s] between looks at the progress


class Pool:
    """Runs jobs on worker processes, on a cluster, or here when one worker is enough.

    Ctrl-C reaches this process only: workers have it blocked, are told through the progress file,
    close what they write, and are waited for. Workers whose master is gone end by themselves.
    """

    def __init__(self, workers: int, cluster: str | None = None) -> None:
        """A pool of that many processes, which start with the first job.

        Args:
            workers: processes on this machine.
            cluster: address of a dask.distributed scheduler, whose workers are taken instead.

        Raises:
            ConfigError: no such scheduler, or its workers have another proxcgal.
        """
        self._workers = workers
        self._cluster = None if cluster is None else Cluster(cluster)
        self._local: Any = None

    def __enter__(self) -> Self:
        """The pool itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Waits for the workers to end; those of a cluster go on without us."""
        if self._local is not None:
            self._local.shutdown(wait=True)
        if self._cluster is not None:
            self._cluster.close()

    def run(
        self,
        jobs: Sequence[Job],
        on_progress: Callable[[list[float]], None] | None = None,
        on_done: Callable[[int, Any], None] | None = None,
        on_lost: Callable[[int], Any] | None = None,
    ) -> list[Any]:
        """All jobs' results, in the jobs' order.

        A job whose worker died is repeated once, alone, so that nobody else is blamed for it; a
        cluster does so by itself.

        Args:
            jobs: each is called with a function that takes its share done.
            on_progress: called with all jobs' shares, now and then.
            on_done: called with a job's row and result, as each ends.
            on_lost: called with the row of a job that killed its worker again; gives its result.

        Raises:
            SimulationError: a worker died (killed, or out of memory) and nobody asked `on_lost`.
            Exception: the first that a job raised; the others are stopped.
        """
        with tempfile.TemporaryDirectory(prefix="proxcgal-") as folder:
            path = Path(folder) / "progress"
            run = _Run(
                jobs, path, on_progress or (lambda _: None), on_done or (lambda *_: None),
                on_lost or _died,
            )  # fmt: skip
            if self._cluster is not None:
                run.far(self._cluster)
            elif self._workers > 1:
                run.near(self._workers, self._processes)
            else:
                run.here()
            return run.results

    def _processes(self, anew: bool) -> Executor:
        """The local workers; `anew`: others in place of these, which are broken."""
        if anew and self._local is not None:
            self._local.shutdown(wait=True, kill_workers=True)
            self._local = None
        if self._local is None:
            from joblib.externals.loky import ProcessPoolExecutor  # 0.1 s

            self._local = ProcessPoolExecutor(
                self._workers, initializer=end_with, initargs=(os.getpid(),)
            )
        executor: Executor = self._local
        return executor


class _Run:
    """One batch of jobs on its way."""

    def __init__(
        self,
        jobs: Sequence[Job],
        path: Path,
        tell: Callable[[list[float]], None],
        done: Callable[[int, Any], None],
        lost: Callable[[int], Any],
    ) -> None:
        self._jobs = jobs
        self._path = path
        self._progress = Progress(path, len(jobs))
        self._tell, self._done, self._lost = tell, done, lost
        self._running: dict[Future[Any], int] = {}
        self.results: list[Any] = [None] * len(jobs)

    def here(self) -> None:
        """One after the other, in this process."""
        for row, job in enumerate(self._jobs):

            def report(share: float, row: int = row) -> None:
                self._progress.report(row, share)
                self._tell(self._progress.shares())

            self._take(row, job(report))

    def near(self, workers: int, executor: Callable[[bool], Executor]) -> None:
        """On worker processes; `executor` gives them, new ones where the others are broken.

        Never more jobs under way than workers, so that it is known which a dead one had. Whoever
        had one is suspected, and goes on alone.
        """
        waiting, suspects = deque(range(len(self._jobs))), deque[int]()
        suspected: set[int] = set()
        with self._stopped():
            while waiting or suspects or self._running:
                alone = bool(suspects) or not suspected.isdisjoint(self._running.values())
                broken = False
                while (suspects or waiting) and len(self._running) < (1 if alone else workers):
                    if broken := not self._submit(executor(False), (suspects or waiting)[0]):
                        break
                    (suspects or waiting).popleft()
                dead = self._collect(POLL_S, BrokenExecutor)
                if dead or broken:  # one dead worker takes all the others with it
                    dead += self._collect(None, BrokenExecutor)
                    executor(True)
                for row in dead:
                    if row in suspected:
                        self._take(row, self._lost(row))
                    else:
                        suspects.append(row)
                        suspected.add(row)

    def far(self, cluster: Cluster) -> None:
        """On a cluster, which queues them and repeats those of dead workers itself."""
        with self._stopped():
            for row, job in enumerate(self._jobs):
                self._running[cluster.executor.submit(work_far, job)] = row
            while self._running:
                try:
                    dead = self._collect(POLL_S, cluster.killed)
                except (CancelledError, ImportError) as error:  # gone, or a worker without us
                    reason = str(error) or "it is gone"
                    raise SimulationError(
                        f"--cluster {cluster.address}: lost on the way: {reason}"
                    ) from None
                for row in dead:
                    self._take(row, self._lost(row))

    def _submit(self, executor: Executor, row: int) -> bool:
        """Gives a job to the workers; false where one of them died meanwhile."""
        try:
            with interrupts_blocked():  # workers inherit it
                future = executor.submit(work, self._jobs[row], str(self._path), row)
        except BrokenExecutor:
            return False
        self._running[future] = row
        return True

    def _collect(self, timeout: float | None, died: type[BaseException]) -> list[int]:
        """Takes what ended meanwhile (no timeout: all); the rows of those whose worker died."""
        until = FIRST_COMPLETED if timeout else ALL_COMPLETED
        ended, _ = wait(self._running, timeout, until)
        self._tell(self._progress.shares())
        dead = []
        for future in ended:
            row = self._running.pop(future)
            try:
                result = future.result()
            except died:
                dead.append(row)
            else:
                self._take(row, result)
        return sorted(dead)

    def _take(self, row: int, result: Any) -> None:
        self.results[row] = result
        self._progress.report(row, 1.0)
        self._tell(self._progress.shares())
        self._done(row, result)

    @contextmanager
    def _stopped(self) -> Iterator[None]:
        """Whatever goes wrong: all jobs are told to stop, and those on this machine waited for."""
        try:
            yield
        except BaseException:
            self._progress.stop()
            for future in self._running:
                future.cancel()
            wait([future for future in self._running if not future.cancelled()])
            raise


def _died(row: int) -> Any:
    raise SimulationError(
        "a worker process died (killed, or out of memory); --workers 1 needs least memory"
    )


def default_workers(jobs: int) -> int:
    """As many as there are jobs, at most one a processor that this process may use."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return max(1, min(jobs, usable or 1))

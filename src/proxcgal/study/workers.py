"""Jobs side by side: worker processes with progress, that end cleanly on request, or a cluster.

Local workers are joblib's (loky), which come to life again when one was killed.
"""

import os
import tempfile
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Future,
    wait,
)
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from joblib.externals.loky import ProcessPoolExecutor

from proxcgal.core.closing import Closing
from proxcgal.core.errors import SimulationError
from proxcgal.study.cluster import Cluster, work_far
from proxcgal.study.jobs import Job, SharedProgress, end_with, interrupts_blocked, work

POLL_S = 0.1  # [s] between looks at the progress


class Pool(Closing):
    """Runs jobs on worker processes, on a cluster, or here when one worker is enough.

    Ctrl-C reaches this process only: workers have it blocked, read the request to stop from the
    progress file, close what they write, and are waited for. Workers whose master is gone end
    by themselves.
    """

    def __init__(self, workers: int, cluster: str | None = None) -> None:
        """A pool of that many processes, which start with the first job.

        Args:
            workers: processes on this machine.
            cluster: address of a dask.distributed scheduler, whose workers are taken instead.

        Raises:
            ConfigError: no such scheduler, or its workers have another proxcgal.
        """
        self._workers = [_Worker() for _ in range(workers)]
        self._cluster = None if cluster is None else Cluster(cluster)

    def close(self) -> None:
        """Waits for the workers to end; those of a cluster go on without us."""
        for worker in self._workers:
            worker.close()
        if self._cluster is not None:
            self._cluster.close()

    def run(
        self,
        jobs: Sequence[Job],
        on_progress: Callable[[list[float]], None] | None = None,
        on_done: Callable[[int, Any], None] | None = None,
        on_lost: Callable[[int, int], Any] | None = None,
    ) -> list[Any]:
        """All jobs' results, in the jobs' order.

        A job whose worker died is repeated once. A cluster does so by itself, and what it gives up
        is given to it once more, alone, so that no job is blamed for another.

        Args:
            jobs: each is called with a function that takes its share done.
            on_progress: called with all jobs' shares, now and then.
            on_done: called with a job's row and result, as each ends.
            on_lost: called with the row of a job that killed its worker again, and how many workers
                died with it; gives its result.

        Raises:
            SimulationError: a worker died (killed, or out of memory) and there is no `on_lost`.
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
            elif len(self._workers) > 1:
                run.near(self._workers)
            else:
                run.here()
            return run.results


class _Worker:
    """One process, that comes to life with its first job, and again when it was killed.

    One process an executor: whose job a dead one had is then known.
    """

    def __init__(self) -> None:
        self._process: Any = None

    def submit(self, *arguments: Any) -> Future[Any]:
        """Gives it a job, as `work` takes it, when it has none."""
        while True:
            if self._process is None:
                self._process = ProcessPoolExecutor(
                    1, initializer=end_with, initargs=(os.getpid(),)
                )
            try:
                with interrupts_blocked():  # the process inherits it
                    future: Future[Any] = self._process.submit(work, *arguments)
            except BrokenExecutor:  # killed since its last job
                self._process.shutdown(wait=True, kill_workers=True)
                self._process = None
            else:
                return future

    def close(self) -> None:
        """Waits for it to end."""
        if self._process is not None:
            self._process.shutdown(wait=True)


class _Run:
    """One batch of jobs on its way."""

    def __init__(
        self,
        jobs: Sequence[Job],
        path: Path,
        tell: Callable[[list[float]], None],
        done: Callable[[int, Any], None],
        lost: Callable[[int, int], Any],
    ) -> None:
        self._jobs = jobs
        self._path = path
        self._progress = SharedProgress(path, len(jobs))
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

    def near(self, workers: Sequence[_Worker]) -> None:
        """On worker processes, one job each: a job whose worker died is repeated once."""
        waiting, died = deque(range(len(self._jobs))), set[int]()
        idle, busy = list(workers), dict[Future[Any], _Worker]()
        with self._stopped():
            while waiting or self._running:
                while waiting and idle:
                    row, worker = waiting.popleft(), idle.pop()
                    future = worker.submit(self._jobs[row], str(self._path), row)
                    self._running[future], busy[future] = row, worker
                for row in self._collect(BrokenExecutor):
                    if row in died:
                        self._take(row, self._lost(row, 2))
                    else:
                        died.add(row)
                        waiting.appendleft(row)
                idle += [busy.pop(future) for future in list(busy.keys() - self._running.keys())]

    def far(self, cluster: Cluster) -> None:
        """On a cluster, which queues them and repeats those of dead workers itself.

        It also gives up jobs that only waited in the queues of dead workers: each of those is
        given to it once more, with no other job of ours beside it.
        """
        with self._stopped():
            for row in self._far(cluster, range(len(self._jobs))):
                for again, killed in self._far(cluster, [row]).items():
                    self._take(again, self._lost(again, cluster.deaths(killed)))

    def _far(self, cluster: Cluster, rows: Iterable[int]) -> dict[int, BaseException]:
        """These jobs on a cluster; those that it gave up."""
        for row in rows:
            self._running[cluster.executor.submit(work_far, self._jobs[row])] = row
        given_up: dict[int, BaseException] = {}
        while self._running:
            try:
                given_up |= self._collect(cluster.killed)
            except (CancelledError, ImportError) as error:  # gone, or a worker without us
                raise SimulationError(
                    f"--cluster {cluster.address}: lost on the way: {str(error) or 'it is gone'}"
                ) from None
        return dict(sorted(given_up.items()))

    def _collect(self, died: type[BaseException]) -> dict[int, BaseException]:
        """Takes what ended meanwhile; the rows of those whose worker died."""
        ended, _ = wait(self._running, POLL_S, FIRST_COMPLETED)
        self._tell(self._progress.shares())
        dead = {}
        for future in ended:
            row = self._running[future]
            try:
                result = future.result()
            except died as error:
                dead[row] = error
            else:
                self._take(row, result)
            del self._running[future]  # not before: what is interrupted here is taken again
        return dead

    def _take(self, row: int, result: Any) -> None:
        self.results[row] = result
        self._progress.note(row, 1.0)
        self._tell(self._progress.shares())
        self._done(row, result)

    @contextmanager
    def _stopped(self) -> Iterator[None]:
        """Whatever goes wrong: all jobs are requested to stop, those on this machine waited for.

        What ended with a result all the same is taken.
        """
        try:
            yield
        except BaseException:
            self._progress.stop()
            for future in self._running:
                future.cancel()
            left = {f: row for f, row in self._running.items() if not f.cancelled()}
            wait(left)
            with suppress(Exception):  # what went wrong first is raised
                for future, row in left.items():
                    if future.exception() is None:
                        self._take(row, future.result())
            raise


def _died(row: int, deaths: int) -> Any:
    raise SimulationError(
        "a worker process died (killed, or out of memory); --workers 1 needs least memory"
    )


def default_workers(jobs: int) -> int:
    """As many as there are jobs, at most one a processor that this process may use."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return max(1, min(jobs, usable or 1))

"""Jobs side by side: results in order, errors told, no worker left behind."""

import functools
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import proxcgal as px
from proxcgal.study.jobs import StoppedError
from proxcgal.study.pool import Pool, default_workers

JOBS = """
import os, signal, time
from pathlib import Path

def square(number, report):
    report(0.5)
    return number * number

def fail(report):
    raise ValueError("on purpose")

def die(report):
    os.kill(os.getpid(), signal.SIGKILL)

def long(mark, report):
    try:
        for step in range(1000):
            time.sleep(0.01)
            report(step / 1000)
    except BaseException as error:
        Path(mark).write_text(type(error).__name__)
        raise
"""


@pytest.fixture
def jobs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Jobs in a module that worker processes can import."""
    (tmp_path / "pool_jobs.py").write_text(JOBS)
    monkeypatch.syspath_prepend(tmp_path)
    import pool_jobs  # type: ignore[import-not-found]

    return pool_jobs


def squares(jobs: ModuleType) -> list[Callable[..., Any]]:
    return [functools.partial(jobs.square, number) for number in range(5)]


@pytest.mark.parametrize("workers", [1, 2])
def test_results_come_in_the_order_of_the_jobs(jobs: ModuleType, workers: int) -> None:
    done: dict[int, int] = {}
    shares: list[list[float]] = []
    with Pool(workers) as pool:
        results = pool.run(squares(jobs), shares.append, done.__setitem__)
    assert results == [0, 1, 4, 9, 16]
    assert done == dict(enumerate(results))
    assert all(0.0 <= share <= 1.0 for row in shares for share in row)
    assert shares[-1] == [1.0] * 5


def test_a_pool_runs_one_batch_after_another(jobs: ModuleType) -> None:
    with Pool(2) as pool:
        assert pool.run(squares(jobs)) == pool.run(squares(jobs))


@pytest.mark.parametrize("workers", [1, 2])
def test_an_error_of_a_job_reaches_the_caller(jobs: ModuleType, workers: int) -> None:
    with Pool(workers) as pool, pytest.raises(ValueError, match="on purpose"):
        pool.run([*squares(jobs), jobs.fail])


def test_an_error_stops_the_jobs_beside_it(jobs: ModuleType, tmp_path: Path) -> None:
    mark = tmp_path / "mark"
    with Pool(2) as pool, pytest.raises(ValueError, match="on purpose"):
        pool.run([functools.partial(jobs.long, str(mark)), jobs.fail])
    assert not mark.exists() or mark.read_text() == StoppedError.__name__


def test_a_worker_that_dies_is_told_as_such(jobs: ModuleType) -> None:
    with Pool(2) as pool, pytest.raises(px.SimulationError, match="worker process died"):
        pool.run([*squares(jobs), jobs.die])


def test_no_more_workers_than_jobs() -> None:
    assert default_workers(1) == 1
    assert default_workers(10**6) >= 1

"""Jobs side by side: results in order, errors told, no worker left behind."""

import functools
import gc
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import proxcgal as px
from proxcgal.study.jobs import StoppedError
from proxcgal.study.workers import Pool, default_workers

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

def pid(report):
    return os.getpid()

def deaf(mark, report):
    Path(mark).touch()
    time.sleep(0.5)
    return "whole"

def fail_after(mark, report):
    while not Path(mark).exists():
        time.sleep(0.01)
    raise ValueError("on purpose")

def once(mark, report):
    with open(mark, "a") as begun:
        begun.write("x")
    time.sleep(0.2)

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


def test_a_result_that_comes_while_the_others_are_stopped_is_taken(
    jobs: ModuleType, tmp_path: Path
) -> None:
    mark = str(tmp_path / "mark")
    done: dict[int, str] = {}
    both = [functools.partial(jobs.deaf, mark), functools.partial(jobs.fail_after, mark)]
    with Pool(2) as pool, pytest.raises(ValueError, match="on purpose"):
        pool.run(both, on_done=done.__setitem__)
    assert done == {0: "whole"}


def test_the_death_of_an_idle_worker_costs_no_job(jobs: ModuleType, tmp_path: Path) -> None:
    marks = [tmp_path / name for name in "abcd"]
    with Pool(2) as pool:
        for pid in set(pool.run([jobs.pid] * 4)):
            os.kill(pid, signal.SIGKILL)
        time.sleep(0.5)
        pool.run([functools.partial(jobs.once, str(mark)) for mark in marks])
    assert [mark.read_text() for mark in marks] == ["x"] * 4


def test_a_death_costs_only_the_dead_ones_job(jobs: ModuleType, tmp_path: Path) -> None:
    marks = [tmp_path / name for name in "abc"]
    work = [functools.partial(jobs.once, str(mark)) for mark in marks]
    with Pool(2) as pool:
        results = pool.run([jobs.die, *work], on_lost=lambda row, deaths: (row, deaths))
    assert results == [(0, 2), None, None, None]
    assert [mark.read_text() for mark in marks] == ["x"] * 3


def test_a_worker_that_dies_is_told_as_such(jobs: ModuleType) -> None:
    with Pool(2) as pool, pytest.raises(px.SimulationError, match="worker process died"):
        pool.run([*squares(jobs), jobs.die])


def test_no_more_workers_than_jobs() -> None:
    assert default_workers(1) == 1
    assert default_workers(10**6) >= 1


def test_an_address_that_is_none_leaves_no_half_made_client() -> None:
    pytest.importorskip("distributed")
    with pytest.raises(px.ConfigError, match="--cluster foo: no scheduler answers there"):
        Pool(1, "foo")
    assert not [each for each in gc.get_objects() if type(each).__name__ == "Client"]

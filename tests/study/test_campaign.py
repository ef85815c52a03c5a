"""Many trials: none is repeated, none is lost, and how they were run changes no number."""

import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import proxcgal as px
from proxcgal.scenario.loading import load_scenario
from proxcgal.study.campaign import Campaign, Trial
from proxcgal.study.campaign_store import CampaignStore, Outcome
from proxcgal.study.execution import perform_trials, unfinished
from proxcgal.study.static import campaign as static_campaign
from proxcgal.study.trial_simulation import robot_of
from proxcgal.study.workers import Pool

SMALL = ("--scenario", "front_plane", "--runs", "2", "--set", "duration=0.2")
ONE = (*SMALL[:3], "1", *SMALL[4:], "--workers", "1", "--quiet")
PROGRAM = [sys.executable, "-c", "import sys; from proxcgal.cli.main import main; sys.exit(main())"]

PERFORM = """
import os, signal
from pathlib import Path

from proxcgal.study.static import campaign as static_campaign

def ours(trial):
    return (trial.controller, trial.tags["draw"]) == ("sm", 0)

def numbers(trial, report):
    report(0.5)
    return {"number": trial.tags["draw"] + len(trial.controller)}

def dies_once(trial, report):
    if ours(trial) and not Path("died").exists():
        Path("died").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return numbers(trial, report)

def dies_always(trial, report):
    if ours(trial):
        os.kill(os.getpid(), signal.SIGKILL)
    return numbers(trial, report)

def dies_once_truly(trial, report):
    with open("begun", "a") as begun:
        begun.write(trial.name + "\\n")
    if ours(trial) and not Path("died").exists():
        Path("died").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return static_campaign.perform(trial, report)

def fails(trial, report):
    if ours(trial):
        raise RuntimeError("on purpose")
    return numbers(trial, report)
"""


Call = Callable[..., Any]


@pytest.fixture
def call(call: Call) -> Call:
    """`proxcgal campaign static` in an empty folder."""
    return partial(call, "campaign", "static")


@pytest.fixture
def performs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """What may be done with a trial, in a module that worker processes can import."""
    (tmp_path / "performs.py").write_text(PERFORM)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    import performs  # type: ignore[import-not-found]

    return performs


def summary(folder: Path) -> bytes:
    return (folder / "summary.json").read_bytes()


def trial_files(folder: Path) -> dict[str, int]:
    """When each finished trial was written."""
    return {path.name: path.stat().st_mtime_ns for path in (folder / "trials").glob("*.json")}


def wait_until(true: Callable[[], bool], patience: float = 120.0) -> None:
    end = time.monotonic() + patience
    while not true():
        assert time.monotonic() < end
        time.sleep(0.02)


# --- Interruptions


def test_after_a_kill_of_everything_two_workers_go_on_and_give_the_summary_of_one(
    call: Call, whole: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "killed"
    arguments = [*PROGRAM, "campaign", "static", *SMALL, "--workers", "2", "--keep", "worst:1"]
    program = subprocess.Popen(
        [*arguments, "--out", folder], stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    wait_until(lambda: len(trial_files(folder)) >= 2)
    os.kill(program.pid, signal.SIGKILL)
    program.communicate()
    before = trial_files(folder)
    assert 2 <= len(before) < 8
    answer = call(*SMALL, "--workers", "2", "--keep", "worst:1", "--out", folder)
    assert answer.code == 0
    after = trial_files(folder)
    assert len(after) == 8
    assert {name: after[name] for name in before} == before
    assert " of 8: front_plane-1-wb_memory: " in answer.err
    assert answer.err.count(" of 8: ") == 8 - len(before)
    assert summary(folder) == summary(whole)
    wait_until(lambda: not members(program.pid), 90.0)


def members(session: int) -> list[str]:
    """Processes that are left of a program that was started as a session of its own."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:  # it ended meanwhile
            continue
        if int(fields[3]) == session and fields[0] != "Z":
            found.append(stat.parent.name)
    return found


def test_ctrl_c_tells_what_is_kept_and_how_to_go_on(tmp_path: Path) -> None:
    program = subprocess.Popen(
        [*PROGRAM, "campaign", "static", *SMALL[:-1], "duration=2.0", "--workers", "2", "--quiet"],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    folder = tmp_path / "out" / "campaign-static"
    wait_until(lambda: len(trial_files(folder)) >= 1)
    os.killpg(program.pid, signal.SIGINT)
    out, err = program.communicate(timeout=60)
    assert program.returncode == 130
    assert out == ""
    kept = len(trial_files(folder))
    assert err == (
        f"proxcgal: interrupted; {kept} of 8 trials are kept in out/campaign-static; the same "
        "command goes on from there\n"
    )
    wait_until(lambda: not members(program.pid))


def test_a_trial_whose_worker_was_killed_is_run_again(
    performs: ModuleType, planned: Campaign, tmp_path: Path
) -> None:
    campaign = replace(planned, perform=performs.dies_once, columns=["number"])
    with Pool(2) as pool, CampaignStore(tmp_path / "store", {}) as store:
        ended = perform_trials(campaign, store, pool)
    assert (tmp_path / "died").exists()
    assert [each.outcome.error for each in ended] == [None] * 8
    with Pool(1) as pool, CampaignStore(tmp_path / "other", {}) as store:
        alone = perform_trials(replace(campaign, perform=performs.numbers), store, pool)
    assert [each.outcome.row for each in ended] == [each.outcome.row for each in alone]


@pytest.mark.parametrize(
    ("perform", "error"),
    [("fails", "RuntimeError: on purpose (performs.py:"), ("dies_always", "worker process died")],
)
def test_a_trial_that_fails_stops_no_other(
    performs: ModuleType, planned: Campaign, tmp_path: Path, perform: str, error: str
) -> None:
    campaign = replace(planned, perform=getattr(performs, perform), columns=["number"])
    with Pool(2) as pool, CampaignStore(tmp_path / "store", {}) as store:
        ended = perform_trials(campaign, store, pool)
        left = unfinished(campaign, store)
    failed = [each for each in ended if each.outcome.row is None]
    assert [each.trial.name for each in failed] == ["front_plane-0-sm"]
    assert error in (failed[0].outcome.error or "")
    assert left == [failed[0].trial]


def test_a_failed_trial_is_told_with_what_repeats_it(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = static_campaign.simulate_trial

    def simulate(scenario: object, controller: str, *rest: object, **keys: object) -> object:
        if controller == "sm":
            raise px.SimulationError("MuJoCo warned")
        return real(scenario, controller, *rest, **keys)  # type: ignore[arg-type]

    monkeypatch.setattr(static_campaign, "simulate_trial", simulate)
    answer = call(*ONE, "--keep", "none", "--out", "here")
    assert answer.code == 1
    command = answer.err.splitlines()[-1].removeprefix("proxcgal:").strip()
    assert answer.err.startswith("proxcgal: front_plane-0-sm: failed: MuJoCo warned\n")
    assert command.startswith("proxcgal run front_plane --controller sm --seed 0 --set duration=0")
    told = json.loads(summary(Path("here")))
    assert told["failed"] == [
        {"name": "front_plane-0-sm", "error": "MuJoCo warned", "command": command}
    ]
    assert told["scenes"]["front_plane"]["controllers"]["wb"]["trials"] == 1


def test_a_campaign_of_which_every_trial_fails_still_tells_so(
    call: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    def simulate(*_: object, **__: object) -> object:
        raise px.SimulationError("MuJoCo warned")

    monkeypatch.setattr(static_campaign, "simulate_trial", simulate)
    answer = call(*ONE, "--out", "here")
    assert answer.code == 1
    assert answer.err.count(": failed: MuJoCo warned\n") == 4
    assert json.loads(summary(Path("here")))["scenes"]["front_plane"]["gain_mm"] is None


# --- The same on any number of workers, in any order, on a cluster


def test_order_changes_no_number(call: Call, planned: Campaign, whole: Path) -> None:
    shuffled = list(planned.trials)
    random.Random(1).shuffle(shuffled)
    there = json.loads((whole / "campaign.json").read_text())
    with Pool(1) as pool, CampaignStore(Path("here"), there) as store:
        perform_trials(replace(planned, trials=shuffled), store, pool)
    again = (*SMALL, "--workers", "1", "--keep", "worst:1", "--quiet", "--out", "here")
    assert call(*again).code == 0
    assert summary(Path("here")) == summary(whole)


@pytest.fixture
def cluster() -> Iterator[Callable[..., str]]:
    """Starts a scheduler with two workers, or as many as asked for; gives its address."""
    distributed = pytest.importorskip("distributed")
    with contextlib.ExitStack() as clusters:

        def start(workers: int = 2) -> str:
            cluster = distributed.LocalCluster(
                n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None
            )
            address: str = clusters.enter_context(cluster).scheduler_address
            return address

        yield start


def test_a_cluster_that_loses_a_worker_with_its_trial_gives_the_summary_of_one_process(
    call: Call,
    whole: Path,
    performs: ModuleType,
    cluster: Callable[..., str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(static_campaign, "perform", performs.dies_once_truly)
    address = cluster()
    answer = call(*SMALL, "--cluster", address, "--keep", "worst:1", "--quiet", "--out", "far")
    assert answer.code == 0
    begun = Path("begun").read_text().split()
    assert begun.count("front_plane-0-sm") == 2
    assert len(set(begun)) == 8
    assert summary(Path("far")) == summary(whole)


def test_a_trial_that_kills_every_worker_of_a_cluster_stops_no_other(
    performs: ModuleType, planned: Campaign, cluster: Callable[..., str], tmp_path: Path
) -> None:
    dask = pytest.importorskip("dask")
    with dask.config.set({"distributed.scheduler.allowed-failures": 0}):
        address = cluster()
    campaign = replace(planned, perform=performs.dies_always, columns=["number"])
    with Pool(1, address) as pool, CampaignStore(tmp_path / "store", {}) as store:
        ended = perform_trials(campaign, store, pool)
    assert [each.outcome.error for each in ended] == [
        None, "its worker process died, once (out of memory?)", *[None] * 6,
    ]  # fmt: skip


def test_a_cluster_without_workers_is_told_as_such(
    call: Call, cluster: Callable[..., str], tmp_path: Path
) -> None:
    address = cluster(0)
    answer = call("--runs", "1", "--quiet", "--cluster", address)
    assert answer.code == 2
    assert answer.err == (
        f"proxcgal: --cluster {address}: has no workers; start some with `dask worker {address} "
        "--nthreads 1`\n"
    )
    assert not (tmp_path / "out").exists()


def test_a_half_written_trial_is_none(planned: Campaign, tmp_path: Path) -> None:
    key = planned.trials[0].key
    with CampaignStore(tmp_path, {}) as store:
        store.put(Outcome(key=key, row={"number": 1}))
        assert store.outcomes([key])[key].row == {"number": 1}
        file = tmp_path / "trials" / f"{key}.json"
        file.write_bytes(file.read_bytes()[:-9])
        assert store.outcomes([key]) == {}


def test_a_key_belongs_to_what_a_trial_is_and_not_to_where_it_stands(planned: Campaign) -> None:
    trial = planned.trials[0]
    assert replace(trial, tags={"draw": 9}, source="elsewhere").key == trial.key
    other = [
        replace(trial, seed=1), replace(trial, controller="sm"), planned.trials[3],
        replace(trial, scenario=load_scenario("front_plane")),
    ]  # fmt: skip
    assert len({trial.key, *(each.key for each in other)}) == 5


def test_names_of_trials_lead_nowhere(planned: Campaign) -> None:
    trial: Trial = replace(planned.trials[0], tags={"scene": "../../etc/x", "draw": 0})
    assert "/" not in trial.name
    assert not trial.name.startswith(".")


# --- Bad input


@pytest.mark.parametrize(
    ("arguments", "lines"),
    [
        (["--runs", "0"], ["--runs 0: must be 1 or more"]),
        (
            ["--keep", "best:3", "--seed", "-1"],
            [
                "--keep best:3: must be worst:N, such as worst:5, or none",
                "--seed -1: must be 0 or more",
            ],
        ),
        (["--workers", "0"], ["--workers 0: must be 1 or more"]),
        (["--set", "seed=3"], ["--set seed=...: every draw has its own; --seed fixes them all"]),
        (["--set", "obstacle=[]"], ["scenario front_plane: scenes can be drawn round one with "]),
        (["--set", "duration=-1"], ["front_plane.toml: override duration = -1: must be greater "]),
        (
            ["--scenario", "nowhere"],
            ["scenario 'nowhere': no built-in scenario has that name, and no file; a path to "],
        ),
        (
            ["--scenario", "front_plane", "front_plane"],
            ["--scenario front_plane: there is another one named front_plane"],
        ),
        (["--cluster", "tcp://127.0.0.1:1"], ["--cluster tcp://127.0.0.1:1: no scheduler answers"]),
        (["--cluster", "what"], ["--cluster what: no scheduler answers there: "]),
        (["--set", "q0=[0,0]"], ["scenario front_plane: q0 has 2 values: ur10e has 6 joints"]),
    ],
)
def test_bad_input_is_told_in_a_line_a_problem_and_nothing_is_written(
    call: Call,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    lines: list[str],
) -> None:
    monkeypatch.setattr("proxcgal.study.cluster.CONNECT_S", 0.5)
    answer = call("--runs", "1", *arguments)
    assert answer.code == 2
    told = answer.err.splitlines()
    assert len(told) == len(lines)
    for line, expected in zip(told, lines, strict=True):
        assert line.startswith("proxcgal: ")
        assert expected in line
    assert list(tmp_path.iterdir()) == []


def test_another_campaigns_folder_is_refused(call: Call, whole: Path) -> None:
    before = trial_files(whole)
    answer = call(*SMALL, "--seed", "3", "--out", whole)
    assert answer.code == 2
    assert answer.err.splitlines()[-1] == (
        f"proxcgal: --out {whole}: holds another campaign: seed is 0 there and 3 here; name "
        "another folder, or remove that one"
    )
    assert trial_files(whole) == before


def test_a_folder_of_another_build_is_refused(
    call: Call, whole: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("proxcgal.core.provenance.build", lambda: "another")
    answer = call(*SMALL, "--quiet", "--out", whole)
    assert answer.code == 2
    assert "holds another campaign: made_with is " in answer.err


def test_a_folder_of_other_results_is_refused(tmp_path: Path) -> None:
    (tmp_path / "summary.json").write_text("{}")
    with pytest.raises(px.ConfigError, match="holds results of something else"):
        CampaignStore(tmp_path, {})
    assert [path.name for path in tmp_path.iterdir()] == ["summary.json"]


def test_scenes_whose_names_files_cannot_tell_apart_are_refused(call: Call) -> None:
    content = load_scenario("front_plane").to_toml()
    for name in ("a b", "a_b"):
        Path(f"{name}.toml").write_text(content.replace('name = "front_plane"', f'name = "{name}"'))
    answer = call("--runs", "1", "--quiet", "--scenario", "a b.toml", "a_b.toml")
    assert answer.code == 2
    assert answer.err == "proxcgal: --scenario a_b.toml: there is another one named a_b\n"


def test_another_robot_under_the_same_name_is_refused(planned: Campaign) -> None:
    trial = planned.trials[0]
    slower = load_scenario("front_plane", ["limits.speed=0.5"])
    assert robot_of(trial.scenario, trial.robot_digest).digest == trial.robot_digest
    assert robot_of(slower).digest != trial.robot_digest
    with pytest.raises(px.ConfigError, match="robot ur10e is another one here"):
        static_campaign.perform(replace(trial, robot_digest="another"), lambda _: None)


def test_two_processes_do_not_work_in_one_folder(call: Call, whole: Path) -> None:
    description = json.loads((whole / "campaign.json").read_text())
    with CampaignStore(whole, description):
        answer = call(*SMALL, "--quiet", "--out", whole)
    assert answer.code == 2
    assert "another process is at work on this campaign" in answer.err


def test_a_store_that_is_closed_twice_closes_nothing_else(tmp_path: Path) -> None:
    store = CampaignStore(tmp_path / "one", {})
    store.close()
    with CampaignStore(tmp_path / "other", {}):  # has the handle of the first
        store.close()
        with pytest.raises(px.ConfigError, match="another process is at work"):
            CampaignStore(tmp_path / "other", {})

"""Many trials: what each is, what it is called, and how all of them come to an end."""

from __future__ import annotations

import functools
import hashlib
import json
import re
import shlex
import time as clock
import traceback
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from proxcgal.core.errors import ConfigError, ProxError
from proxcgal.core.progress import OnProgress
from proxcgal.study.jobs import StoppedError
from proxcgal.study.store import Cell, Outcome, Row, Store
from proxcgal.study.workers import Pool

if TYPE_CHECKING:
    from proxcgal.scenario.scenario import Scenario


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One run of a campaign."""

    scenario: Scenario  # resolved: nothing is read again where it runs
    source: str  # the name or file that it was read from
    overrides: tuple[str, ...] = ()  # and changed by
    controller: str  # empty where the kind has none
    seed: int
    robot_digest: str | None = None  # of the robot that it was planned with
    tags: Mapping[str, Cell] = field(default_factory=dict)  # which one it is: columns of the table

    @property
    def key(self) -> str:
        """The same for the same trial, in whatever campaign, place and order."""
        content = json.dumps([self.scenario.to_toml(), self.controller, self.seed])
        return hashlib.sha256(content.encode()).hexdigest()[:20]

    @property
    def name(self) -> str:
        """For people and files."""
        return plain("-".join(filter(None, [*map(str, self.tags.values()), self.controller])))

    @property
    def command(self) -> str:
        """What a user types to repeat it."""
        words = ["proxcgal", "run", self.source]
        words += ["--controller", self.controller] if self.controller else []
        words += ["--seed", str(self.seed)]
        return shlex.join(words + (["--set", *self.overrides] if self.overrides else []))


def plain(name: str) -> str:
    """A name as a file can have it: a scenario's own may hold anything."""
    return re.sub(r"[^\w.-]|^\.", "_", name)


Perform = Callable[[Trial, OnProgress], Row]


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """Trials, and what is done with each."""

    description: Mapping[str, Any]  # plain JSON values: a folder belongs to one description
    trials: Sequence[Trial]
    perform: Perform  # of a module, so that workers find it
    columns: Sequence[str]  # names of the numbers that it gives
    notes: Mapping[str, Any] = field(default_factory=dict)  # on how the trials came about

    def __post_init__(self) -> None:
        """Raises: ConfigError: two trials of one name, which their recordings would share."""
        (name, count), *_ = Counter(trial.name for trial in self.trials).most_common(1) or [("", 0)]
        if count > 1:
            raise ConfigError(f"campaign: {count} trials are called {name}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended:
    """A trial and what became of it."""

    trial: Trial
    outcome: Outcome


def unfinished(campaign: Campaign, store: Store) -> list[Trial]:
    """The trials that the store does not hold, or holds as failed or with other numbers.

    Raises:
        ConfigError: a trial stands twice in the campaign.
    """
    trials = {trial.key: trial for trial in campaign.trials}
    if len(trials) < len(campaign.trials):
        twice = next(trial for trial in campaign.trials if trials[trial.key] is not trial)
        raise ConfigError(f"campaign: {twice.name} stands in it twice")
    columns = set(campaign.columns)
    ended = {key for key, o in store.outcomes(trials).items() if o.row and o.row.keys() == columns}
    return [trial for key, trial in trials.items() if key not in ended]


def run_campaign(
    campaign: Campaign,
    store: Store,
    pool: Pool,
    on_progress: Callable[[list[float]], None] | None = None,
    on_done: Callable[[Trial, Outcome], None] | None = None,
) -> list[Ended]:
    """Performs every unfinished trial; one that fails is kept with its error and stops nothing.

    Args:
        campaign: what to run.
        store: gets every outcome as soon as there is one.
        pool: does the work.
        on_progress: told the shares done of the unfinished trials, now and then.
        on_done: told every trial that ended, after it is stored.

    Returns:
        All trials in the campaign's order, whoever ran them, whenever and where.

    Raises:
        ConfigError: a trial stands twice in the campaign.
        SimulationError: the cluster was lost on the way.
    """
    todo = unfinished(campaign, store)

    def done(row: int, outcome: Outcome) -> None:
        store.put(outcome)
        if on_done is not None:
            on_done(todo[row], outcome)

    def lost(row: int, deaths: int) -> Outcome:
        times = {1: "once", 2: "twice"}.get(deaths, f"{deaths} times")
        return Outcome(
            key=todo[row].key, error=f"its worker process died, {times} (out of memory?)"
        )

    pool.run(
        [functools.partial(_attempt, campaign.perform, trial) for trial in todo],
        on_progress, done, lost,
    )  # fmt: skip
    outcomes = store.outcomes(trial.key for trial in campaign.trials)
    return [Ended(trial=trial, outcome=outcomes[trial.key]) for trial in campaign.trials]


def _attempt(perform: Perform, trial: Trial, report: OnProgress) -> Outcome:
    """One trial, in whichever process; what goes wrong becomes part of the outcome."""
    begin = clock.perf_counter()
    try:
        row, error = perform(trial, report), None
    except StoppedError:
        raise
    except Exception as problem:
        row, error = None, told(problem)
    return Outcome(key=trial.key, row=row, error=error, wall_s=clock.perf_counter() - begin)


def told(problem: Exception) -> str:
    """What went wrong; with the place where nobody meant it to."""
    if isinstance(problem, ProxError):
        return str(problem)
    place = traceback.extract_tb(problem.__traceback__)[-1]
    at = f"{place.filename.rpartition('/')[2]}:{place.lineno}"
    return f"{type(problem).__name__}: {problem} ({at})"

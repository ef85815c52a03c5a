"""A campaign: what a kind of it is, its trials and how they are planned, tables for people."""

import hashlib
import json
import re
import shlex
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import polars as pl
from matplotlib.figure import Figure

from proxcgal.core.errors import ConfigError
from proxcgal.core.progress import OnProgress
from proxcgal.core.tables import aligned
from proxcgal.evaluation.metrics import Summary
from proxcgal.models.robots import Robot
from proxcgal.scenario.scenario import Scenario
from proxcgal.scenario.setup import Setup
from proxcgal.study.campaign_store import Outcome, Row, Value
from proxcgal.study.trial_simulation import robot_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Listing:
    """A table for people, in a terminal and on a page."""

    caption: str
    names: Sequence[str]  # of the columns
    units: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: int  # so many columns flush left

    def __str__(self) -> str:
        """Its lines, for a terminal."""
        heads = [self.names]
        if any(self.units):
            heads.append([f"[{unit}]" if unit else "" for unit in self.units])
        return aligned([*heads, *self.rows], left=self.left, heads=len(heads))


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One run of a campaign."""

    scenario: Scenario  # resolved: nothing is read again where it runs
    source: str  # the name or file that it was read from
    overrides: tuple[str, ...] = ()  # and changed by
    controller: str  # empty where the kind has none
    seed: int
    robot_digest: str | None = None  # of the robot that it was planned with
    tags: Mapping[str, Value] = field(default_factory=dict)  # which one it is: columns of the table

    @property
    def key(self) -> str:
        """The same for the same trial, in whatever campaign, place and order."""
        content = json.dumps([self.scenario.to_toml(), self.controller, self.seed])
        return hashlib.sha256(content.encode()).hexdigest()[:20]

    @property
    def name(self) -> str:
        """For people and files."""
        return file_name("-".join(filter(None, [*map(str, self.tags.values()), self.controller])))

    @property
    def command(self) -> str:
        """What a user types to repeat it."""
        controller = ["--controller", self.controller] if self.controller else []
        changes = ["--set", *self.overrides] if self.overrides else []
        seed = ["--seed", str(self.seed)]
        return shlex.join(["proxcgal", "run", self.source, *controller, *seed, *changes])


def file_name(name: str) -> str:
    """A name with the characters that a file's name may have; a scenario's own may hold any."""
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


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignRequest:
    """What a user asks a campaign for."""

    runs: int  # draws of each scene, or subjects
    seed: int
    scenarios: tuple[str, ...] = ()  # names or files, instead of the kind's own
    overrides: tuple[str, ...] = ()  # `key.sub=value`, for all trials
    controllers: tuple[str, ...] = ()  # instead of the kind's own
    jitter: bool = True  # where the kind repeats its trials with moved positions


def ranked(*among: pl.Expr, **by: bool) -> Callable[[pl.DataFrame], list[str]]:
    """Ranks trials that did not fail: gives their keys, the first to look at first.

    Args:
        among: which trials; left out: all.
        by: columns to sort by, true where the largest comes first; equal ones are sorted by key.
    """

    def keys(table: pl.DataFrame) -> list[str]:
        own = table.filter(pl.col("error").is_null(), *among)
        order = own.sort(*by, "key", descending=[*by.values(), False], nulls_last=True)
        return order["key"].to_list()

    return keys


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignKind:
    """One kind of campaign; a further one needs no more than this."""

    title: str  # of its page
    introduction: str | Callable[[Summary], str]  # below the title
    plan: Callable[[CampaignRequest], Campaign]
    analyse: Callable[[pl.DataFrame, Campaign], Summary]
    listings: Callable[[Summary], Iterable[Listing]]
    verdicts: Callable[[Summary], Iterator[str]]  # a sentence each, from the numbers
    figures: Callable[[pl.DataFrame, Summary], dict[str, Figure]]  # by file
    captions: Callable[[Summary], dict[str, str]]  # of the same files
    worst: Callable[[pl.DataFrame], list[str]] = lambda _: []  # keys of trials, the worst first
    worst_of: str = "all trials"  # among which these are looked for, and by what
    pages: Callable[[Summary], dict[str, str]] = lambda _: {}  # further text, by file
    runs: int = 100  # default of the request
    # Trials of one scene to show side by side, in a moving picture; none where it is left out.
    side_by_side: Callable[[Campaign], list[Trial]] | None = None


class CampaignPlan:
    """Scenes and trials so far."""

    def __init__(self, kind: str, request: CampaignRequest, scenarios: Sequence[str]) -> None:
        """No trial yet.

        Args:
            kind: of the campaign.
            request: what the user asks for.
            scenarios: names or files of the kind's own, which the request may replace.
        """
        self.scenarios = request.scenarios or tuple(scenarios)
        self.trials: list[Trial] = []
        self._kind, self._request = kind, request
        self._names: set[str] = set()
        self._digests: dict[str, str] = {}

    def add_scene(
        self, source: str, base: Scenario, name: str | None = None, *, by: str = "named"
    ) -> Setup:
        """Sets a scene up before anything is drawn round it.

        Args:
            source: name or file that it was read from.
            base: the scene.
            name: that no other scene of the campaign may have; left out: its own, as a file's.
            by: what the name is, in the message about a second one.

        Raises:
            ProxError: what does not fit, a second scene of that name.
        """
        setup = Setup.of(base, robot_of(base))
        name = file_name(base.name) if name is None else name
        if file_name(name) in self._names:
            raise ConfigError(f"--scenario {source}: there is another one {by} {name}")
        self._names.add(file_name(name))
        scene = hashlib.sha256(base.to_toml().encode()).hexdigest()[:16]
        self._digests |= {
            f"scene {base.name}": scene,
            f"robot of {base.name}": setup.robot.digest,
        }
        return setup

    def add_robot(self, name: str, robot: Robot) -> None:
        """Notes the robot of trials whose scenes have no digest of their own."""
        self._digests[f"robot of {name}"] = robot.digest

    def add_trial(
        self,
        scenario: Scenario,
        source: str,
        overrides: Sequence[str],
        controller: str,
        seed: int,
        robot: Robot,
        /,
        **tags: Value,
    ) -> None:
        """Adds a trial; `seed` counts from the request's, `tags` say which trial it is."""
        self.trials.append(
            Trial(
                scenario=scenario, source=source, overrides=tuple(overrides), controller=controller,
                seed=self._request.seed + seed, robot_digest=robot.digest, tags=tags,
            )
        )  # fmt: skip

    def campaign(self, perform: Perform, columns: Sequence[str], **notes: object) -> Campaign:
        """The planned campaign.

        Args:
            perform: performs a trial.
            columns: names of the numbers that it gives.
            notes: on how the trials came about.
        """
        return Campaign(
            description={
                "kind": self._kind, "seed": self._request.seed, "scenarios": list(self.scenarios),
                "set": list(self._request.overrides), **self._digests,
            },
            trials=self.trials, perform=perform, columns=columns, notes=notes,
        )  # fmt: skip

"""A campaign: its trials, what each is called, and what is done with it."""

import hashlib
import json
import re
import shlex
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from proxcgal.core.errors import ConfigError
from proxcgal.core.progress import OnProgress
from proxcgal.scenario.scenario import Scenario
from proxcgal.study.campaign_store import Outcome, Row, Value


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

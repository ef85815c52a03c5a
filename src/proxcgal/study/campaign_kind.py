"""What a kind of campaign is: trials planned from a request, and findings from their table."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import polars as pl
from matplotlib.figure import Figure

from proxcgal.evaluation.metrics import Summary
from proxcgal.study.campaign import Campaign, Trial
from proxcgal.study.listing import Listing


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignRequest:
    """What a user asks a campaign for."""

    runs: int  # draws of each scene, or subjects
    seed: int
    scenarios: tuple[str, ...] = ()  # names or files, instead of the kind's own
    overrides: tuple[str, ...] = ()  # `key.sub=value`, for all trials
    controllers: tuple[str, ...] = ()  # instead of the kind's own
    jitter: bool = True  # where the kind repeats its trials with moved positions


def _records_none(table: pl.DataFrame) -> list[str]:
    return []


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
    worst: Callable[[pl.DataFrame], list[str]] = _records_none  # keys of trials, the worst first
    worst_of: str = "all trials"  # among which these are looked for, and by what
    pages: Callable[[Summary], dict[str, str]] = lambda _: {}  # further text, by file
    runs: int = 100  # default of the request
    # Trials of one scene to show side by side, in a moving picture; none where it is left out.
    side_by_side: Callable[[Campaign], list[Trial]] | None = None

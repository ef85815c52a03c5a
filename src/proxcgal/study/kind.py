"""What a kind of campaign is: trials out of wishes, and findings out of the trials' table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from proxcgal.core.tables import aligned
from proxcgal.evaluation.metrics import Summary
from proxcgal.study.campaign import Campaign, Trial

if TYPE_CHECKING:
    import polars as pl
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignRequest:
    """What a user asks a campaign for."""

    runs: int  # draws of each scene, or subjects
    seed: int
    scenarios: tuple[str, ...] = ()  # names or files, instead of the kind's own
    overrides: tuple[str, ...] = ()  # `key.sub=value`, for all trials
    controllers: tuple[str, ...] = ()  # instead of the kind's own
    jitter: bool = True  # where the kind repeats its trials with moved positions


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
class Kind:
    """One kind of campaign; a further one needs no more than this."""

    title: str  # of its page
    introduction: str | Callable[[Summary], str]  # below the title
    plan: Callable[[CampaignRequest], Campaign]
    analyse: Callable[[pl.DataFrame, Campaign], Summary]
    listings: Callable[[Summary], list[Listing]]
    verdicts: Callable[[Summary], list[str]]  # a sentence each, from the numbers
    figures: Callable[[pl.DataFrame, Summary], dict[str, Figure]]  # by file
    captions: Callable[[Summary], dict[str, str]]  # of the same files
    worst: Callable[[pl.DataFrame], list[str]]  # keys of trials, the worst first
    worst_of: str = "all trials"  # among which these are looked for, and by what
    pages: Callable[[Summary], dict[str, str]] | None = None  # further text, by file
    runs: int = 100  # where nothing else is wished for
    # Trials of one scene to show side by side, in a moving picture; none where it is left out.
    shown: Callable[[Campaign], list[Trial]] | None = None

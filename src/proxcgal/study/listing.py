"""A table of results for people."""

from collections.abc import Sequence
from dataclasses import dataclass

from proxcgal.core.tables import aligned


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

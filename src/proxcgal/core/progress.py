"""How far the work is: a bar on a terminal, a line per finished piece elsewhere."""

import sys
from collections.abc import Callable, Sequence
from typing import Any

from proxcgal.core.closing import Closing

#: Called with the share that is done, 0 to 1.
OnProgress = Callable[[float], None]


class ProgressBar(Closing):
    """Share of several pieces of work done, on stderr.

    A bar on a terminal; in a log (CI) a line per finished piece; nothing when quiet.
    """

    def __init__(self, title: str, sizes: Sequence[float], unit: str, *, quiet: bool) -> None:
        """Begins with nothing done.

        Args:
            title: before the bar.
            sizes: of the pieces, in `unit`s.
            unit: what is counted, e.g. "s".
            quiet: say nothing at all.
        """
        self._sizes = sizes
        self._quiet = quiet
        self._bar: Any = None
        if not quiet and sys.stderr.isatty():
            from tqdm import tqdm  # here, because most runs draw no bar

            shape = "{l_bar}{bar}| {n:.0f}/{total:.0f} {unit} [{elapsed}, {remaining} left]"
            self._bar = tqdm(
                total=sum(sizes), desc=title, unit=unit, bar_format=shape, dynamic_ncols=True
            )

    def close(self) -> None:
        """Leaves the bar as it stands."""
        if self._bar is not None:
            self._bar.close()

    def shares(self, shares: Sequence[float]) -> None:
        """Share done of each piece, 0 to 1."""
        if self._bar is not None:
            done = sum(s * size for s, size in zip(shares, self._sizes, strict=True))
            self._bar.update(done - self._bar.n)

    def first(self, count: int) -> None:
        """So many pieces are done, in their order, and none of the others begun."""
        self.shares([1.0] * count + [0.0] * (len(self._sizes) - count))

    def finished(self, text: str) -> None:
        """One piece is done; its line is for logs, a bar shows it anyway."""
        if self._bar is None and not self._quiet:
            print(text, file=sys.stderr, flush=True)


def announce(text: str, *, quiet: bool) -> None:
    """Says on a terminal what is going on while there is nothing to count."""
    if not quiet and sys.stderr.isatty():
        print(text, file=sys.stderr, flush=True)

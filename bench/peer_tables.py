"""The peers' medians as tables, and the document that shows them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from document import markdown_table

from proxcgal.study.timing.grid import ALGORITHMS

HEAD = """## Against other libraries

Median times in microseconds, called from Python on one thread; in brackets how many times as long
as `fast` takes. Inputs: `proxcgal sweep`'s.
"""
FOOT = """
`+ culling`: the same library with our spheres round the links lent to it, in numpy: rays and points
that cannot matter are not asked, the likeliest link and points come first. Float32 libraries may
differ by 10 um in a distance, and in a mask only where a hit is that near to the tolerance; who
differs more is named and not timed. Single times are in `out/bench/peers.csv`."""


def tables(found: Sequence[Any], ours: Sequence[str], culled: str) -> str:
    """Three tables in Markdown: each algorithm, and both together against the best of the others.

    Args:
        found: of `peers.results`.
        ours: names that are no library's; the last is what ratios are taken to.
        culled: end of the names of those that were lent our culling.
    """
    parts = []
    for algorithm, title in ALGORITHMS.items():
        own = [r for r in found if r.algorithm == algorithm]
        parts.append(f"### Algorithm {algorithm}: {title}\n\n" + _table(own, ours[-1]))
    parts.append("### Both algorithms\n\n" + _both(found, ours, culled))
    return "\n\n".join(parts)


def _table(found: Sequence[Any], fast: str) -> str:
    names = list(dict.fromkeys(result.name for result in found))
    head = ("robot", "vertices", "cloud", "points", *names)
    rows = []
    for place, of in _by_input(found).items():
        base = np.median(of[fast].samples_us)
        inputs = of[fast].inputs
        points = inputs.points_W if of[fast].algorithm == 1 else inputs.environment_W
        rows.append((*map(str, place), str(len(points)), *(_cell(of[n], base) for n in names)))
    return markdown_table(head, rows)


def _cell(result: Any, base: float) -> str:
    if result.wrong:
        return result.wrong
    median = float(np.median(result.samples_us))
    return f"{median:.0f} ({median / base:.1f})"


def _both(found: Sequence[Any], ours: Sequence[str], culled: str) -> str:
    """The sum of both algorithms; others may take the best library for each."""
    head = ("robot", "vertices", "cloud", *ours, "best libraries", "ratio",
            "best with culling lent", "ratio")  # fmt: skip
    rows = []
    for place in _by_input(found):
        cells = [_by_input(r for r in found if r.algorithm == n)[place] for n in ALGORITHMS]
        own = [sum(_median(of[name]) for of in cells) for name in ours]
        row = [*map(str, place), *(f"{time:.0f}" for time in own)]
        for lent in (False, True):
            best = [
                min((_median(r), name) for name, r in of.items()
                    if name not in ours and not r.wrong and (lent or not name.endswith(culled)))
                for of in cells
            ]  # fmt: skip
            total = sum(time for time, _ in best)
            row += [f"{total:.0f}: {', '.join(name for _, name in best)}", f"{total / own[-1]:.1f}"]
        rows.append(row)
    return markdown_table(head, rows)


def _median(result: Any) -> float:
    return float(np.median(result.samples_us)) if len(result.samples_us) else np.inf


def _by_input(found: Iterable[Any]) -> dict[tuple[str, int, str], dict[str, Any]]:
    """Results by robot, vertices and cloud, then by name."""
    grouped: dict[tuple[str, int, str], dict[str, Any]] = {}
    for result in found:
        place = (result.inputs.robot.name, result.inputs.vertices, result.inputs.cloud)
        grouped.setdefault(place, {})[result.name] = result
    return grouped

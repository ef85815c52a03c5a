"""The timing grid read across: literal against accelerated, and both against the sensors' cycle."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from proxcgal.core.tables import aligned

CYCLE_US = 66_700.0  # [us] of the sensors; the paper's worst case stays within it


@dataclass(frozen=True, slots=True)
class Comparison:
    """Both methods' cells on the same input, as `summary.json` has them."""

    paper: Mapping[str, Any]
    fast: Mapping[str, Any]

    @property
    def ratio(self) -> float:
        """How many times as fast the accelerated method is."""
        return float(self.paper["median_us"] / self.fast["median_us"])


def compare(cells: Iterable[Mapping[str, Any]]) -> list[Comparison]:
    """Pairs of cells, as `summary.json` has them, that differ in their method alone.

    A cell without its counterpart is left out.
    """
    by_input: dict[tuple[Any, ...], dict[str, Mapping[str, Any]]] = {}
    for cell in cells:
        key = tuple(cell[name] for name in ("robot", "vertices", "cloud", "points", "algorithm"))
        by_input.setdefault(key, {})[cell["method"]] = cell
    return [
        Comparison(of["paper"], of["fast"])
        for of in by_input.values()
        if of.keys() >= {"paper", "fast"}
    ]


def sweep_table(comparisons: Sequence[Comparison]) -> str:
    """A line a comparison, for a terminal."""
    inputs = ("robot", "cloud", "vertices", "points", "algorithm")
    heads = [(*inputs, "paper", "fast", "ratio"), ("", "", "", "", "", "[us]", "[us]", "")]
    rows = [
        (
            *(str(c.paper[key]) for key in inputs),
            f"{c.paper['median_us']:.0f}",
            f"{c.fast['median_us']:.1f}",
            f"{c.ratio:.1f}",
        )
        for c in comparisons
    ]
    return aligned([*heads, *rows], left=2, heads=len(heads))


def cycle_verdict(comparisons: Sequence[Comparison]) -> str:
    """Where both forms, both algorithms on one scan, miss the sensors' cycle, as a sentence."""
    cells: dict[tuple[str, int, str], tuple[float, float]] = {}
    for c in comparisons:
        place = (c.paper["robot"], c.paper["vertices"], c.paper["cloud"])
        paper, fast = cells.get(place, (0.0, 0.0))
        cells[place] = (paper + c.paper["median_us"], fast + c.fast["median_us"])
    missed = [
        f"{robot}, {vertices} vertices, {cloud} cloud: {paper / 1000.0:.0f} ms"
        for (robot, vertices, cloud), (paper, _) in cells.items()
        if paper > CYCLE_US
    ]
    most = max((fast for _, fast in cells.values()), default=0.0)
    ours = f"The accelerated form takes at most {most / 1000.0:.2f} ms."
    budget = f"the paper's {CYCLE_US / 1000.0:g} ms"
    if not missed:
        return f"The literal form, both algorithms together, stays within {budget}. {ours}"
    return (
        f"The literal form, both algorithms together, misses {budget} in {len(missed)} of "
        f"{len(cells)} cells: {'; '.join(missed)}. {ours}"
    )

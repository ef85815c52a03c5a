"""The cell of the human study with every position moved a little, for results beyond one layout."""

import zlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from proxcgal.core.errors import ConfigError
from proxcgal.scenario.hri_scenario import HriScenario
from proxcgal.scenario.loading import change_scenario

JITTER_M = 0.1  # [m] to either side, along each axis
_STREAM = 0x4A6974  # of the seed: subjects and noise draw from others
_MOST = 100  # draws of one layout


@dataclass(frozen=True, slots=True)
class Layout:
    """One cell: as the scenario has it, or moved."""

    scenario: HriScenario
    overrides: tuple[str, ...]
    redrawn: Counter[str]  # why earlier draws were given up


def draw_layout(
    base: HriScenario, overrides: Sequence[str], seed: int, subject: int, *, jitter: bool
) -> Layout:
    """The cell that one subject works in.

    Every coordinate of way points, marks, places and what is sensed beside the person is moved by
    up to 0.1 m, uniformly and each on its own. A cell in which the subject cannot do its task
    is drawn again.

    Args:
        base: the cell as it is.
        overrides: assignments of the subject, already in `base`.
        seed: of the campaign.
        subject: who works there.
        jitter: whether anything is moved.

    Raises:
        ConfigError: nothing was found that the subject can do.
    """
    redrawn: Counter[str] = Counter()
    if not jitter:
        base.person()  # tells what cannot be done
        return Layout(base, tuple(overrides), redrawn)
    name = zlib.crc32(base.name.encode())
    draw = np.random.default_rng([seed, subject, _STREAM, name])
    for _ in range(_MOST):
        moved = _moved(base, draw)
        scenario = change_scenario(base, base.name, moved)
        assert isinstance(scenario, HriScenario)
        try:
            scenario.person()
        except ConfigError as error:
            redrawn["too slow" if ".within" in str(error) else "out of reach"] += 1
            continue
        return Layout(scenario, (*overrides, *moved), redrawn)
    raise ConfigError(
        f"scenario {base.name}: subject {subject}: no moved cell in {_MOST} draws in which the "
        f"task can be done ({', '.join(f'{reason} {n}' for reason, n in redrawn.items())})"
    )


def _moved(base: HriScenario, draw: np.random.Generator) -> list[str]:
    assignments = []
    if base.goal.waypoints is not None:
        points = [_shifted(point, draw) for point in base.goal.waypoints]
        assignments.append(f"goal.waypoints=[{', '.join(points)}]")
    tables = {"marks": base.operator.marks, "places": base.operator.places}
    assignments += [
        f"operator.{table}.{key}={_shifted(places[key], draw)}"
        for table, places in tables.items()
        for key in sorted(places)
    ]
    assignments += [
        f"obstacle.{row}.position={_shifted(obstacle.position, draw)}"
        for row, obstacle in enumerate(base.obstacles)
        if obstacle.sensed
    ]
    return assignments


def _shifted(position: Sequence[float], draw: np.random.Generator) -> str:
    moved = np.asarray(position) + draw.uniform(-JITTER_M, JITTER_M, len(position))
    return "[" + ", ".join(f"{value:.4f}" for value in moved) + "]"

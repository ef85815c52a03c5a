"""Ratings that testers gave, from a user's own table; none is made up."""

import csv
from pathlib import Path

from proxcgal.core.errors import ConfigError

LEAST, MOST = 0.0, 10.0


def read_ratings(path: Path) -> dict[str, list[float]]:
    """Ratings by indicator, in the file's order: a column an indicator, a row a tester.

    Args:
        path: of a CSV file whose first row names the indicators; ratings are 0 to 10, as in [WT]
            4.1. An empty cell is no rating. It may begin with a byte order mark, as spreadsheets
            write it.

    Raises:
        ConfigError: a file that cannot be read, and all cells that are no rating, one line each.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            head, *rows = list(csv.reader(file)) or [[]]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ConfigError(f"ratings {path}: cannot be read: {error}") from None
    names = [name.strip() for name in head]
    if not any(names) or not rows or len(set(names)) < len(names):
        raise ConfigError(
            f"ratings {path}: a first row of different indicators and a row for each tester are "
            "needed"
        )
    found: dict[str, list[float]] = {name: [] for name in names}
    problems = []
    for number, row in enumerate(rows, start=2):
        if len(row) > len(names):
            problems.append(f"ratings {path}: line {number}: {len(row)} cells, {len(names)} named")
        for name, cell in zip(names, row, strict=False):
            if not cell.strip():
                continue
            try:
                value = float(cell)
            except ValueError:
                value = float("nan")
            if LEAST <= value <= MOST:
                found[name].append(value)
            else:
                problems.append(
                    f"ratings {path}: line {number}, {name} = {cell!r}: a number from 0 to 10"
                )
    if problems:
        raise ConfigError("\n".join(problems))
    return {name: values for name, values in found.items() if values}

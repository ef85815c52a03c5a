"""A recorded motion, such as a motion capture gives it, in place of a virtual subject's."""

import csv
from pathlib import Path

import numpy as np

from proxcgal.core.errors import ConfigError
from proxcgal.scene.human.body import PARTS, POINTS
from proxcgal.scene.human.motion import Motion
from proxcgal.scene.human.subject import SHIN, THIGH

HEADER = ("time", *(f"{point}_{axis}" for point in POINTS for axis in "xyz"))
_MOST_ROWS = 1_000_000
_FARTHEST = 100.0  # [m]
_SHORTEST = 1e-3  # [m] of a part: below it has no direction


def write_motion(motion: Motion, path: Path) -> None:
    """A motion as the CSV file that `read_motion` reads: seconds and metres, in the base frame."""
    rows = np.column_stack([motion.time, motion.points_W.reshape(len(motion.time), -1)])
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(HEADER)
        writer.writerows([f"{value:.6g}" for value in row] for row in rows.tolist())


def read_motion(path: str | Path) -> Motion:
    """The motion of a CSV file.

    One row a moment, at least two, times rising; one column for each of HEADER, in any order,
    others are passed over. The capsules' radii follow the stature, which follows the legs.

    Raises:
        ConfigError: no such file, a column that is missing, a value that is no number, times that
            do not rise, a part of the body without length, a body without legs.
    """
    try:
        with Path(path).open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file)
            names = [name.strip() for name in next(reader, [])]
            if missing := [name for name in HEADER if name not in names]:
                raise ConfigError(
                    f"motion {path}: no column {', '.join(missing[:4])}"
                    f"{' ...' if len(missing) > 4 else ''}; needed are time and x, y, z of "
                    f"{', '.join(POINTS)}"
                )
            columns = [names.index(name) for name in HEADER]
            rows = []
            for line, row in enumerate(reader, start=2):
                if row:
                    rows.append(_numbers(row, columns, names, f"motion {path}: line {line}"))
                if len(rows) > _MOST_ROWS:
                    raise ConfigError(f"motion {path}: more than {_MOST_ROWS} rows")
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = error.strerror if isinstance(error, OSError) else "not a CSV file"
        raise ConfigError(f"motion {path}: {reason}") from None
    if len(rows) < 2:
        raise ConfigError(f"motion {path}: has {len(rows)} rows, needs at least 2")
    table = np.array(rows)
    time, points = table[:, 0], table[:, 1:].reshape(len(table), len(POINTS), 3)
    back = np.flatnonzero(np.diff(time) <= 0.0)
    if len(back):
        raise ConfigError(
            f"motion {path}: time = {time[back[0] + 1]:g} after {time[back[0]]:g}: must rise"
        )
    hip, knee, ankle = (POINTS.index(f"left_{joint}") for joint in ("hip", "knee", "ankle"))
    leg = np.median(
        np.linalg.norm(points[:, hip] - points[:, knee], axis=1)
        + np.linalg.norm(points[:, knee] - points[:, ankle], axis=1)
    )
    stature = float(leg) / (THIGH + SHIN)
    if not 0.5 <= stature <= 2.5:
        raise ConfigError(
            f"motion {path}: the legs are {leg:.3g} m long, of somebody of {stature:.3g} m: must "
            "be 0.5 to 2.5 m (are the points in metres?)"
        )
    for part in PARTS:
        start, end = (points[:, POINTS.index(name)] for name in (part.start, part.end))
        short = np.flatnonzero(np.linalg.norm(end - start, axis=1) < _SHORTEST)
        if len(short):
            raise ConfigError(
                f"motion {path}: time = {time[short[0]]:g}: {part.start} and {part.end} are at one "
                f"place: must be {_SHORTEST:g} m apart or more"
            )
    return Motion(time, points, stature)


def _numbers(row: list[str], columns: list[int], names: list[str], place: str) -> list[float]:
    values = []
    for column in columns:
        text = row[column] if column < len(row) else ""
        try:
            value = float(text)
        except ValueError:
            value = np.nan
        if not abs(value) <= (_FARTHEST if names[column] != "time" else 1e9):
            raise ConfigError(
                f"{place}: {names[column]} = {text!r}: must be a number"
                + ("" if names[column] == "time" else f" within {_FARTHEST:g} m")
            )
        values.append(value)
    return values

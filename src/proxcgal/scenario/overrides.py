"""Keys of a scenario set from outside its file: `--set controller.d_min=0.25`."""

import tomllib
from typing import Any

from proxcgal.core import toml
from proxcgal.core.errors import ConfigError


def override(table: toml.Table, assignment: str) -> str:
    """Sets one key of nested tables from `key.sub=value`, in place.

    The value has TOML syntax; what is not a TOML value is taken as a string, so that
    `robot=panda` needs no quotes. A number steps into an array: `obstacle.0.size=[1, 1, 1]`.

    Returns:
        The dotted key that was set, without spaces.

    Raises:
        ConfigError: no `=`, an empty key, more than a value, nested too deeply, or a step into what
            is no table or array.
    """
    key, equals, text = assignment.partition("=")
    steps = [step.strip() for step in key.split(".")]
    if not equals or not all(steps):
        raise ConfigError(f"override {assignment!r}: must have the form key.sub=value")
    if len(steps) > toml.DEEPEST:
        raise ConfigError(f"override {assignment!r}: {toml.TOO_DEEP}")
    try:
        value, *more = toml.loaded(f"value = {text}").values()
    except tomllib.TOMLDecodeError:
        value, more = text.strip(), []
    except RecursionError:
        raise ConfigError(f"override {assignment!r}: {toml.TOO_DEEP}") from None
    if more:
        raise ConfigError(f"override {assignment!r}: must have one value, and no lines after it")
    place: Any = table
    for depth, step in enumerate(steps):
        within: Any = step
        if isinstance(place, list):
            if not (step.isdecimal() and int(step) < len(place)):
                raise ConfigError(
                    f"override {assignment!r}: {'.'.join(steps[:depth])} has the entries "
                    f"0 to {len(place) - 1}, not {step}"
                )
            within = int(step)
            steps[depth] = str(within)
        elif not isinstance(place, dict):
            raise ConfigError(f"override {assignment!r}: {'.'.join(steps[:depth])} is no table")
        if depth == len(steps) - 1:
            place[within] = value
        else:
            place = place.setdefault(within, {}) if isinstance(place, dict) else place[within]
    return ".".join(steps)

"""TOML in and out: with a writer for what the standard library only reads."""

import json
import math
import re
import tomllib
from collections.abc import Iterable, Mapping
from typing import Any

from proxcgal.core.errors import ConfigError

Table = dict[str, Any]

DEEPEST = 64  # levels of tables and arrays: at some hundreds, what reads them would end
TOO_DEEP = f"must not be nested more than {DEEPEST} deep"
_BARE = re.compile(r"[A-Za-z0-9_-]+")  # a key that needs no quotes


def parse(text: str, origin: str) -> Table:
    """The tables of a TOML text.

    Raises:
        ConfigError: it is not TOML; the message names `origin` and the line. It is nested too
            deeply.
    """
    try:
        return loaded(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{origin}: not TOML: {error}") from None
    except RecursionError:
        raise ConfigError(f"{origin}: {TOO_DEEP}") from None


def loaded(text: str) -> Table:
    """Raises: RecursionError: deeper than `DEEPEST`, by brackets or by dotted keys."""
    table = tomllib.loads(text)
    level: list[Any] = [table]
    for _ in range(DEEPEST + 1):
        level = [item for place in level for item in _inside(place)]
        if not level:
            return table
    raise RecursionError


def _inside(place: Any) -> Iterable[Any]:
    if isinstance(place, dict):
        return place.values()
    return place if isinstance(place, list) else ()


def format_value(value: object) -> str:
    """One TOML value, numbers at full precision."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        if math.isnan(value):
            return "nan"
        return repr(value) if math.isfinite(value) else ("inf" if value > 0 else "-inf")
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, list | tuple):
        return "[" + ", ".join(format_value(item) for item in value) + "]"
    if isinstance(value, Mapping):
        pairs = ", ".join(f"{_key(key)} = {format_value(item)}" for key, item in value.items())
        return "{" + pairs + "}"
    return str(value)


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else _quoted(name)


def write(table: Mapping[str, Any], path: str = "") -> str:
    """TOML text of nested tables; keys that are None are left out, `path` is as written."""
    plain, nested = [], []
    for key, value in table.items():
        if value is None:
            continue
        name = f"{path}.{_key(key)}" if path else _key(key)
        if isinstance(value, Mapping):
            nested.append(f"\n[{name}]\n" + write(value, name))
        elif isinstance(value, list | tuple) and value and isinstance(value[0], Mapping):
            nested.extend(f"\n[[{name}]]\n" + write(item, name) for item in value)
        else:
            plain.append(f"{_key(key)} = {format_value(value)}\n")
    return "".join(plain) + "".join(nested)

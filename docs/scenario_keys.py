"""Reference of the scenario keys: the rows of the documentation's tables, made from the schema.

`python docs/scenario_keys.py docs/*.md` brings the tables of these pages up to date.
"""

import re
import sys
from collections.abc import Iterator
from pathlib import Path

from pydantic import BaseModel

from proxcgal.core import toml
from proxcgal.scenario.loading import KINDS
from proxcgal.scenario.problems import models_in

_TABLE = re.compile(r"(?<=\| key \| default \| meaning \|\n\|---\|---\|---\|\n)(?:\|.*\n)+")
_KEY = re.compile(r"^\| `([^`]+)` \|.*$", re.MULTILINE)


def rows_of(model: type[BaseModel], path: str = "") -> list[str]:
    """The rows of a scenario's tables in the documentation: key, default, meaning.

    Args:
        model: a kind of scenario, or a table of one.
        path: keys before it, with a dot.
    """
    rows = []
    for name, field in model.model_fields.items():
        key = f"{path}{field.alias or name}"
        if inner := list(models_in(field.annotation)):
            rows += rows_of(inner[0], f"{key}.")
        else:
            value = field.get_default(call_default_factory=True, validated_data={})
            default = ", ".join(value) if isinstance(value, dict) else toml.format_value(value)
            default = "required" if field.is_required() else default
            rows.append(f"| `{key}` | {default} | {field.description} |".replace("None", "-"))
    return rows


def updated(page: str) -> str:
    """A page whose tables of keys say what the schema says.

    A table of one section (`| `monitor.hold_after` | ...`) gets all keys of that section; in any
    other table the rows of known keys are replaced.
    """
    return _TABLE.sub(lambda table: "".join(f"{row}\n" for row in _table(table[0])), page)


def _table(text: str) -> Iterator[str]:
    keys = _KEY.findall(text)
    sections = {key.partition(".")[0] for key in keys}
    if len(sections) == 1 and all("." in key for key in keys):
        yield from next(rows for kind in KINDS.values() if (rows := _section(kind, *sections)))
        return
    for line in text.splitlines():
        key = _KEY.match(line)
        known = (
            row
            for kind in KINDS.values()
            for row in rows_of(kind)
            if key and row.startswith(f"| `{key[1]}` |")
        )
        yield line if line in (every := list(known)) or not every else every[0]


def _section(kind: type[BaseModel], name: str) -> list[str]:
    return [row for row in rows_of(kind) if row.startswith(f"| `{name}.")]


if __name__ == "__main__":
    for place in map(Path, sys.argv[1:]):
        place.write_text(updated(place.read_text()))

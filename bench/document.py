"""docs/benchmarks.md, section by section: each program replaces its own."""

from __future__ import annotations

import re
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path

from proxcgal.core.provenance import commit, machine

PATH = Path(__file__).parents[1] / "docs" / "benchmarks.md"
_TITLE = """# Benchmarks

`./run bench` measures all of this in one run, on what `./run setup` installs.
"""


def write_section(name: str, text: str, packages: Sequence[str] = (), path: Path = PATH) -> None:
    """Puts a section into the document, in place of the one of that name.

    Args:
        name: of the section, in a comment that readers do not see.
        text: Markdown, its heading first.
        packages: whose versions matter beside our own.
        path: of the document; made where there is none.
    """
    versions = [f"{package} {metadata.version(package)}" for package in ("proxcgal", *packages)]
    made_at = commit(Path(__file__).parent) or "unknown"
    made = f"{machine()}; commit {made_at}; {', '.join(versions)}."
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    section = f"{begin}\n{text.strip()}\n\n{made}\n{end}\n"
    old = path.read_text() if path.is_file() else _TITLE
    pattern = re.compile(re.escape(begin) + ".*?" + re.escape(end) + "\n", re.DOTALL)
    if not pattern.search(old):
        old = f"{old.rstrip()}\n\n{section}"
    path.write_text(pattern.sub(lambda _: section, old))


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table whose first column is text and whose others are numbers."""
    lines = ["| " + " | ".join(head) + " |", "|---|" + "---:|" * (len(head) - 1)]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines)

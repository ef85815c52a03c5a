"""The frame and the tables of every report: one HTML file, no network; all text escaped."""

import base64
from collections.abc import Iterable, Iterator
from html import escape
from importlib import resources
from pathlib import Path

from proxcgal.report.stored_results import About
from proxcgal.study.campaign import Listing

PAGE_BYTES = 10_000_000  # of the whole page
PICTURE_BYTES = PAGE_BYTES - 400_000  # of all its pictures; the rest is text


#: What the page may load: what lies inside of it. No script, unless something plays.
_CLOSED = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
_PLAYS = (
    "default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; font-src data:; "
    "script-src 'unsafe-inline' 'unsafe-eval' blob: data:; worker-src blob: data:; "  # its wasm
    "connect-src blob: data:; frame-src 'self' blob: data:"
)


def document(title: str, parts: Iterable[str]) -> str:
    """A valid HTML page of these parts under that title, its style inside."""
    body = list(parts)
    policy = _PLAYS if any(part.startswith("<script") for part in body) else _CLOSED
    css = resources.files("proxcgal.report").joinpath("report.css").read_text()
    head = (
        "<!DOCTYPE html>",
        '<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
        f"<title>{escape(title)}</title><style>{css}</style></head><body>",
        f"<h1>{escape(title)}</h1>",
    )
    return "\n".join([*head, *body, "</body></html>"]) + "\n"


class Pictures:
    """The figures of one page, as far as its bytes go."""

    def __init__(self, used: int = 0) -> None:
        """Args: `used` bytes of the page, which pictures may not take."""
        self._left = PICTURE_BYTES - used

    def part(self, path: Path, caption: str) -> str:
        """The figure with its picture inside; nothing where there is no such file."""
        if not path.is_file():
            return ""
        size = 4 * ((path.stat().st_size + 2) // 3)
        if size > self._left:
            text = f"left out here to keep the page under {PAGE_BYTES // 1_000_000} MB"
            return f'<p class="soft">{escape(path.name)}: {text}.</p>'
        self._left -= size
        kind = "gif" if path.suffix == ".gif" else "png"
        data = base64.b64encode(path.read_bytes()).decode()
        alt = escape(caption.split(". ")[0], quote=True)
        return (
            f'<figure><img src="data:image/{kind};base64,{data}" alt="{alt}">'
            f"<figcaption>{escape(caption)}</figcaption></figure>"
        )


def table_part(
    heads: Iterable[str], rows: Iterable[Iterable[str]], caption: str = ""
) -> Iterator[str]:
    """A table that scrolls by itself where the page is narrower.

    Args:
        heads: of the columns, as `head` gives them.
        rows: cells as `cell` gives them.
        caption: above it; none where it is empty.
    """
    above = f"<caption>{escape(caption)}</caption>" if caption else ""
    yield f'<div class="scroll"><table>{above}<thead><tr>'
    yield from heads
    yield "</tr></thead><tbody>"
    for row in rows:
        yield "<tr>" + "\n".join(row) + "\n</tr>"
    yield "</tbody></table></div>"


def head(name: str, unit: str = "", style: str = "") -> str:
    """A column's head. Args: its name, its unit, a class of the style sheet."""
    small = f"<small>{escape(unit)}</small>" if unit else ""
    return f"<th{_class(style)}>{escape(name)}{small}</th>"


def cell(text: object, style: str = "", *, rows: int | None = None, bold: bool = False) -> str:
    """A cell. Args: its text, a class of the style sheet, how many rows it spans, in bold?"""
    span = f' rowspan="{rows}"' if rows else ""
    inner = escape(str(text))
    return f"<td{_class(style)}{span}>{f'<b>{inner}</b>' if bold else inner}</td>"


def findings_parts(verdicts: Iterable[str], listings: Iterable[Listing]) -> Iterator[str]:
    """What a study found: its sentences, then its tables."""
    for sentence in verdicts:
        yield f"<p>{escape(sentence)}</p>"
    for listing in listings:
        yield from listing_part(listing)


def listing_part(listing: Listing) -> Iterator[str]:
    """A table of results."""
    styles = ["left" if column < listing.left else "" for column in range(len(listing.names))]
    return table_part(
        map(head, listing.names, listing.units, styles),
        (map(cell, row, styles) for row in listing.rows),
        listing.caption,
    )


def _class(style: str) -> str:
    return f' class="{style}"' if style else ""


def code_names(names: Iterable[str]) -> str:
    """File names in a sentence."""
    return ", ".join(f"<code>{escape(name)}</code>" for name in names)


def recordings_part(folder: Path, more: str = "") -> Iterator[str]:
    """Names the recordings of a folder, where there are any; `more` follows, as HTML."""
    if files := sorted(folder.glob("*.mcap")):
        names = code_names(file.name for file in files)
        yield f'<p class="soft">Recordings of every tick beside this page: {names}.{more}</p>'


def origin_part(about: About) -> Iterator[str]:
    """How the results were made, and where the method comes from."""
    yield "<h2>How this was made</h2>"
    if about.command:
        yield f'<pre class="wrap">{escape(about.command)}</pre>'
    rows = [("made", about.made), ("commit", about.commit), ("machine", about.machine)]
    rows += about.versions.items()
    yield "<table><tbody>"
    for name, value in (*rows, ("[WA]", _PAPER)):
        if value:
            yield f"<tr>{cell(name, 'left')}{cell(value, 'wide')}</tr>"
    yield "</tbody></table>"


_PAPER = (
    "S. Borelli et al., Generating Whole-Arm Avoidance Motion Through Localized Proximity Sensing, "
    "IEEE/ASME Trans. Mechatronics, 2025, doi:10.1109/TMECH.2025.3582432"
)

"""Tables of a report as HTML; text is escaped."""

from collections.abc import Iterable, Iterator
from html import escape

from proxcgal.study.listing import Listing


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

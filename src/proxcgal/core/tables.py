"""Tables and numbers for a reader."""

from collections.abc import Sequence

from proxcgal.core.files import NOTHING_M


def aligned(rows: Sequence[Sequence[str]], *, left: int, heads: int) -> str:
    """Rows as lines of columns: the first `left` flush left, a rule below the first `heads`."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = []
    for row in rows:
        cells = [
            cell.ljust(width) if column < left else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    lines.insert(heads, "-" * max(map(len, lines)))
    return "\n".join(lines)


def counted(number: int, noun: str) -> str:
    """A count for a reader: "1 subject", "2 subjects"."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def in_metres(value: float | None) -> str:
    """A length for a reader [m]: millimetre digits, a dash where there is none."""
    if value is None:
        return "-"
    return "none" if value >= NOTHING_M else f"{value:.3f}"


def capitalised(text: str) -> str:
    """Text with a capital first; the rest as it is."""
    return text[:1].upper() + text[1:]

"""The frame of every report: one HTML file, no network, no other file; all text escaped."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Iterator
from html import escape
from importlib import resources
from pathlib import Path

from proxcgal.report.stored import About

MAX_BYTES = 10_000_000  # of the whole page
REPLAY_BYTES = 6_000_000  # of that, at most, for what plays in 3D
PICTURE_BYTES = MAX_BYTES - 400_000  # of all its pictures; the rest is text


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


def picture(path: Path, caption: str, budget: int) -> tuple[str, int]:
    """The figure with its picture inside, and the bytes that it takes of the page."""
    if not path.is_file():
        return "", 0
    size = 4 * ((path.stat().st_size + 2) // 3)
    if size > budget:
        text = f"left out here to keep the page under {MAX_BYTES // 1_000_000} MB"
        return f'<p class="soft">{escape(path.name)}: {text}.</p>', 0
    kind = "gif" if path.suffix == ".gif" else "png"
    data = base64.b64encode(path.read_bytes()).decode()
    alt = escape(caption.split(". ")[0], quote=True)
    part = f'<figure><img src="data:image/{kind};base64,{data}" alt="{alt}">'
    return part + f"<figcaption>{escape(caption)}</figcaption></figure>", size


def origin_part(about: About) -> Iterator[str]:
    """How the results were made, and where the method comes from."""
    yield "<h2>How this was made</h2>"
    if about.command:
        yield f'<pre class="wrap">{escape(about.command)}</pre>'
    rows = [("made", about.made), ("commit", about.commit), ("machine", about.machine)]
    rows += about.versions.items()
    yield "<table><tbody>"
    for name, value in rows:
        if value:
            yield f'<tr><td class="left">{escape(name)}</td>'
            yield f'<td class="wide">{escape(value)}</td></tr>'
    yield '<tr><td class="left">[WA]</td><td class="wide">S. Borelli et al., Generating '
    yield "Whole-Arm Avoidance Motion Through Localized Proximity Sensing, IEEE/ASME Trans. "
    yield "Mechatronics, 2025, doi:10.1109/TMECH.2025.3582432</td></tr></tbody></table>"

"""The HTML of a report on a campaign."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from html import escape
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from proxcgal.cli.campaign import KINDS
from proxcgal.core.errors import ConfigError
from proxcgal.report.document import (
    PICTURE_BYTES,
    REPLAY_BYTES,
    document,
    origin_part,
    picture,
)
from proxcgal.report.replays import Replays
from proxcgal.report.stored import StoredCampaign
from proxcgal.study.worst_recordings import FOLDER

if TYPE_CHECKING:
    from proxcgal.study.kind import Kind, Listing


def campaign_page(stored: StoredCampaign) -> str:
    """The page of a campaign: valid HTML, everything inside.

    Raises:
        ConfigError: a kind that is not known here, or a summary of another form.
    """
    path, name = stored.folder / "summary.json", stored.summary["campaign"]
    if name not in KINDS:
        raise ConfigError(f"{path}: campaign = {name!r}: there are {', '.join(KINDS)}")
    kind: Kind = import_module(KINDS[name]).KIND
    try:
        return document(kind.title, _parts(kind, stored))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        reason = f"{type(error).__name__}: {error}"
        raise ConfigError(f"{path}: not the summary of a {name} campaign: {reason}") from None


def _parts(kind: Kind, stored: StoredCampaign) -> Iterator[str]:
    summary = stored.summary
    told = kind.introduction
    yield f"<p>{escape(told if isinstance(told, str) else told(summary))}</p>"
    for sentence in kind.verdicts(summary):
        yield f"<p>{escape(sentence)}</p>"
    for listing in kind.listings(summary):
        yield from listing_part(listing)
    replays = Replays(REPLAY_BYTES)
    worst = _replay_of_worst(stored, replays)
    budget = PICTURE_BYTES - replays.used
    for name, caption in kind.captions(summary).items():
        part, used = picture(stored.folder / Path(name).name, caption, budget)
        budget -= used
        yield part
    yield from _commands(stored, worst, kind.worst_of)
    yield from origin_part(stored.about)
    yield from replays.parts()


def listing_part(listing: Listing) -> Iterator[str]:
    """A table as HTML."""
    yield f'<div class="scroll"><table><caption>{escape(listing.caption)}</caption><thead><tr>'
    for column, (name, unit) in enumerate(zip(listing.names, listing.units, strict=True)):
        side = ' class="left"' if column < listing.left else ""
        small = f"<small>{escape(unit)}</small>" if unit else ""
        yield f"<th{side}>{escape(name)}{small}</th>"
    yield "</tr></thead><tbody>"
    for row in listing.rows:
        yield "<tr>"
        for column, cell in enumerate(row):
            side = ' class="left"' if column < listing.left else ""
            yield f"<td{side}>{escape(cell)}</td>"
        yield "</tr>"
    yield "</tbody></table></div>"


def _replay_of_worst(stored: StoredCampaign, replays: Replays) -> str:
    """The first of the worst that was recorded, in 3D."""
    for entry in stored.summary["worst"]:
        # A summary's words must not lead out of the folder.
        file = stored.folder / FOLDER / Path(str(entry.get("recording", ""))).name
        if file.is_file():
            return replays.of_runs(stored.folder, [file])
    return ""


def _commands(stored: StoredCampaign, replay: str, worst_of: str) -> Iterator[str]:
    """What steps through the worst trials, and what runs them and the failed ones again."""
    if stored.summary["worst"]:
        yield "<h2>The worst</h2>"
        yield f"<p>Of {escape(worst_of)}.</p>"
        yield replay
    for entry in stored.summary["worst"]:
        if "error" in entry:
            reason = f"{entry['name']}: not recorded: {entry['error']}"
            yield f"<p>{escape(reason)}</p>"
            yield f'<pre class="wrap">{escape(str(entry["command"]))}</pre>'
            continue
        file = stored.folder / str(entry["recording"])
        replay = shlex.join(("proxcgal", "replay", str(file)))
        yield f'<pre class="wrap">{escape(replay)}\n{escape(str(entry["command"]))}</pre>'
    if stored.summary["failed"]:
        yield "<h2>Failed trials</h2>"
    for entry in stored.summary["failed"]:
        yield f"<p>{escape(str(entry['name']))}: {escape(str(entry['error']))}</p>"
        yield f'<pre class="wrap">{escape(str(entry["command"]))}</pre>'

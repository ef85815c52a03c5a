"""The HTML of a report on a campaign."""

import shlex
from collections.abc import Iterator
from html import escape
from pathlib import Path

from proxcgal.report.document import Pictures, document, findings_parts, origin_part
from proxcgal.report.replays import Replays
from proxcgal.report.stored_results import StoredResults
from proxcgal.study.campaign import CampaignKind
from proxcgal.study.worst_recordings import FOLDER


def campaign_page(kind: CampaignKind, stored: StoredResults) -> str:
    """The page of a campaign: valid HTML, everything inside."""
    return document(kind.title, _parts(kind, stored))


def _parts(kind: CampaignKind, stored: StoredResults) -> Iterator[str]:
    summary = stored.summary
    text = kind.introduction
    yield f"<p>{escape(text if isinstance(text, str) else text(summary))}</p>"
    yield from findings_parts(kind.verdicts(summary), kind.listings(summary))
    replays = Replays()
    worst = _replay_of_worst(stored, replays)
    pictures = Pictures(replays.used)
    for name, caption in kind.captions(summary).items():
        yield pictures.part(stored.folder / Path(name).name, caption)
    yield from _commands(stored, worst, kind.worst_of)
    yield from origin_part(stored.about)
    yield from replays.parts()


def _replay_of_worst(stored: StoredResults, replays: Replays) -> str:
    """The first of the worst that was recorded, in 3D."""
    for entry in stored.summary["worst"]:
        # A summary's text must not lead out of the folder.
        file = stored.folder / FOLDER / Path(str(entry.get("recording", ""))).name
        if file.is_file():
            return replays.of_runs(stored.folder, [file])
    return ""


def _commands(stored: StoredResults, replay: str, worst_of: str) -> Iterator[str]:
    """Commands that step through the worst trials, and that run them and the failed ones again."""
    if stored.summary["worst"]:
        yield "<h2>The worst</h2>"
        yield f"<p>Of {escape(worst_of)}.</p>"
        yield replay
    for entry in stored.summary["worst"]:
        command = escape(str(entry["command"]))
        if "error" in entry:
            reason = f"{entry['name']}: not recorded: {entry['error']}"
            yield f"<p>{escape(reason)}</p>"
        else:
            file = stored.folder / str(entry["recording"])
            command = f"{escape(shlex.join(('proxcgal', 'replay', str(file))))}\n{command}"
        yield f'<pre class="wrap">{command}</pre>'
    if stored.summary["failed"]:
        yield "<h2>Failed trials</h2>"
    for entry in stored.summary["failed"]:
        yield f"<p>{escape(str(entry['name']))}: {escape(str(entry['error']))}</p>"
        yield f'<pre class="wrap">{escape(str(entry["command"]))}</pre>'

"""The HTML of a report on runs of the 12-joint robot."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from typing import TYPE_CHECKING, Any

from proxcgal.core.errors import ConfigError
from proxcgal.report.campaign_page import listing_part
from proxcgal.report.document import PICTURE_BYTES, document, origin_part, picture

if TYPE_CHECKING:
    from proxcgal.report.stored import StoredCampaign


def joint_page(stored: StoredCampaign) -> str:
    """The page of one scene's runs: valid HTML, everything inside.

    Raises:
        ConfigError: a summary of another form.
    """
    try:
        return document(f"{stored.summary['scenario']}: 12 joints", _parts(stored))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        reason = f"{type(error).__name__}: {error}"
        path = stored.folder / "summary.json"
        raise ConfigError(f"{path}: not the summary of joint runs: {reason}") from None


def _parts(stored: StoredCampaign) -> Iterator[str]:
    from proxcgal.study.joint.texts import listings, verdicts
    from proxcgal.study.runs.joint import FIGURE

    summary: dict[str, Any] = stored.summary
    yield f"<p>{escape(stored.about.description)}</p>"
    for run in summary["runs"]:
        where = f"From {run['init']}, {run['perception']}, {', '.join(run['tasks'])}: "
        yield f"<p>{escape(where + run['outcome'] + ': ' + run['reason'])}.</p>"
    for sentence in verdicts(summary):
        yield f"<p>{escape(sentence)}</p>"
    for listing in listings(summary):
        if listing.rows:
            yield from listing_part(listing)
    part, _ = picture(
        stored.folder / FIGURE,
        "Speed at the tool by each arm, activations of the tasks, true distance.", PICTURE_BYTES,
    )  # fmt: skip
    yield part
    yield (
        '<p class="soft">Kinematic runs: the robot has no inertias. Engineering figures from a '
        "simulation, not a certificate of any kind.</p>"
    )
    files = sorted(stored.folder.glob("*.mcap"))
    if files:
        names = ", ".join(f"<code>{escape(file.name)}</code>" for file in files)
        yield f'<p class="soft">Recordings of every tick beside this page: {names}.</p>'
    yield from origin_part(stored.about)

"""The HTML of a report on runs of the 12-joint robot."""

from collections.abc import Iterator
from html import escape

from proxcgal.report.document import (
    Pictures,
    document,
    findings_parts,
    origin_part,
    recordings_part,
)
from proxcgal.report.stored_results import StoredResults
from proxcgal.study.joint.texts import listings, verdicts
from proxcgal.study.runs.joint import FIGURE


def joint_page(stored: StoredResults) -> str:
    """The page of one scene's runs: valid HTML, everything inside."""
    return document(f"{stored.summary['scenario']}: 12 joints", _parts(stored))


def _parts(stored: StoredResults) -> Iterator[str]:
    summary = stored.summary
    yield f"<p>{escape(stored.about.description)}</p>"
    for run in summary["runs"]:
        where = f"From {run['init']}, {run['perception']}, {', '.join(run['tasks'])}: "
        yield f"<p>{escape(where + run['outcome'] + ': ' + run['reason'])}.</p>"
    yield from findings_parts(verdicts(summary), (each for each in listings(summary) if each.rows))
    yield Pictures().part(
        stored.folder / FIGURE,
        "Speed at the tool by each arm, activations of the tasks, true distance.",
    )
    yield (
        '<p class="soft">Kinematic runs: the robot has no inertias. Engineering figures from a '
        "simulation, not a certificate of any kind.</p>"
    )
    yield from recordings_part(stored.folder)
    yield from origin_part(stored.about)

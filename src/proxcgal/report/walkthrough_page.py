"""The HTML of a report on a walk-through."""

from collections.abc import Iterator
from html import escape

from proxcgal.report.document import PICTURE_BYTES, Pictures, code_names, document, origin_part
from proxcgal.report.stored_results import StoredResults
from proxcgal.study.runs.walkthrough import (
    FIGURE,
    RATINGS,
    RECORDING,
    TABLE,
    TRAJECTORY,
    walkthrough_lines,
)

_TAUGHT = (
    "Above: speed of the tool while it is taught at the process's speed and by the hand-guiding "
    "rules, the limits, and the Safe Torque Off signal, scaled. Middle: distance to the operator, "
    "with what ISO/TS 15066 would ask for; the path as taught and as played back. Below: how far "
    "the two are apart."
)
_TRIPPED = (
    "The quantity that tripped, its limit, and the Safe Torque Off signal, scaled, in the form of "
    "the paper's Figs. 6 to 8; right, magnified. Red: the trip. Green: all joints at rest. Between "
    "the two the brakes have yet to close: weight and hand still move the arm."
)
_RATED = (
    "Testers' ratings, from the user's own table, in the form of the paper's Fig. 9: box plot with "
    "median (orange) and mean (green), and the share of testers that gave each rating."
)
#: Form and numbers that the paper prints for the same.
_PAPER = {
    "tcp_speed": "Fig. 6: trip at 1.30 m/s, at rest within 0.35 s.",
    "distance": "Fig. 7: trip at 0.455 m, at rest within 0.35 s.",
    "relative_velocity": "Fig. 8: trip at 1.30 m/s, at rest within 0.35 s.",
}


def walkthrough_page(stored: StoredResults) -> str:
    """The page of a walk-through: valid HTML, everything inside."""
    return document(f"Walk-through programming: {stored.summary['scenario']}", _parts(stored))


def _parts(stored: StoredResults) -> Iterator[str]:
    summary = stored.summary
    if text := stored.about.description:
        yield f"<p>{escape(text[:1].upper() + text[1:])}.</p>"
    for line in walkthrough_lines(summary):
        tag = "pre" if "\n" in line else "p"
        yield f"<{tag}>{escape(line)}</{tag}>"
    trips = summary["trips"]
    if trips and (paper := _PAPER.get(trips[0]["function"])):
        yield f"<p>The paper [WT], {escape(paper)}</p>"
    yield Pictures().part(stored.folder / FIGURE, _TRIPPED if trips else _TAUGHT)
    yield Pictures(3 * PICTURE_BYTES // 4).part(stored.folder / RATINGS, _RATED)
    pairs = ", ".join(map(str, summary["monitored_pairs"]))
    yield f"<p>Distance to the operator is monitored of: {escape(pairs)}.</p>"
    for entry in summary["accepted"]:
        yield f"<p>Accepted, {escape(str(entry['item']))}: {escape(str(entry['text']))}.</p>"
    yield (
        '<p class="soft">The operator is simulated, and so are weight and brakes; lengths, masses '
        "and brakes of the arm are ours. Engineering figures, not a certificate of any kind.</p>"
    )
    there = [name for name in (RECORDING, TABLE, TRAJECTORY) if (stored.folder / name).is_file()]
    if there:
        yield f'<p class="soft">Beside this page: {code_names(there)}.</p>'
    yield from origin_part(stored.about)
    if stored.settings:
        yield "<h3>Settings</h3>"
        yield f"<pre>{escape(stored.settings)}</pre>"

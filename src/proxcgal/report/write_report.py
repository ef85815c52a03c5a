"""A folder of results becomes one self-contained HTML page."""

import functools
from collections.abc import Callable
from pathlib import Path

from proxcgal.core.errors import ConfigError
from proxcgal.core.files import write_text
from proxcgal.report.campaign_page import campaign_page
from proxcgal.report.joint_page import joint_page
from proxcgal.report.runs_page import runs_page
from proxcgal.report.stored_results import (
    SUMMARY,
    StoredResults,
    read_json,
    read_results,
    read_runs,
    read_sweep,
)
from proxcgal.report.sweep_page import sweep_page
from proxcgal.report.walkthrough_page import walkthrough_page
from proxcgal.study.kinds import KINDS


def write_report(folder: Path) -> Path:
    """Writes `report.html` of a folder of results, from what lies in it.

    Args:
        folder: of one run, of several scenarios' runs (one sub-folder each), of a timing grid, a
            campaign or a walk-through.

    Returns:
        Path of the page: at most 10 MB, pictures inside, nothing fetched from anywhere.

    Raises:
        ConfigError: no such folder, no `summary.json` in it, or files that cannot be read.
    """
    path = folder / SUMMARY
    summary = read_json(path)
    if "cells" in summary:
        text = sweep_page(read_sweep(folder))
    elif "campaign" in summary:
        name = summary["campaign"]
        if name not in KINDS:
            raise ConfigError(f"{path}: campaign = {name!r}: there are {', '.join(KINDS)}")
        page = functools.partial(campaign_page, KINDS[name])
        text = _checked(page, read_results(folder), f"a {name} campaign")
    elif "trips" in summary:
        text = _checked(walkthrough_page, read_results(folder), "a walk-through")
    elif "runs" in summary:
        text = _checked(joint_page, read_results(folder), "joint runs")
    else:
        text = runs_page(*read_runs(folder))
    report = folder / "report.html"
    write_text(report, text)
    return report


def _checked(page: Callable[[StoredResults], str], stored: StoredResults, what: str) -> str:
    """The page. Raises: ConfigError: a summary of another form."""
    try:
        return page(stored)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        reason = f"{type(error).__name__}: {error}"
        raise ConfigError(
            f"{stored.folder / SUMMARY}: not the summary of {what}: {reason}"
        ) from None

"""`proxcgal report`: a folder of results becomes one self-contained HTML page."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from proxcgal.core.files import write_text


@dataclass(frozen=True)
class ReportOptions:
    """Write DIR/report.html: one self-contained page of the results in DIR.

    Examples:
      proxcgal report out/demo
      proxcgal report out/front_plane
      proxcgal report out/sweep
      proxcgal report out/campaign-static
    """

    dir: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DIR")]
    """A folder that `proxcgal run`, `proxcgal demo` or `proxcgal sweep` wrote, or a
    finished `proxcgal campaign`."""


def report_command(options: ReportOptions, command: str) -> int:
    """Writes the page; prints its path."""
    print(write_report(options.dir))
    return 0


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
    from proxcgal.report.campaign_page import campaign_page
    from proxcgal.report.joint_page import joint_page
    from proxcgal.report.stored import read_campaign, read_joint, read_runs, read_sweep, read_walk
    from proxcgal.report.sweep_page import sweep_page
    from proxcgal.report.trials_page import page
    from proxcgal.report.walkthrough_page import walk_page

    if sweep := read_sweep(folder):
        text = sweep_page(sweep)
    elif campaign := read_campaign(folder):
        text = campaign_page(campaign)
    elif walk := read_walk(folder):
        text = walk_page(walk)
    elif joint := read_joint(folder):
        text = joint_page(joint)
    else:
        text = page(*read_runs(folder))
    path = folder / "report.html"
    write_text(path, text)
    return path

"""`proxcgal report`: a folder of results becomes one self-contained HTML page."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


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
    from proxcgal.report.write_report import write_report

    print(write_report(options.dir))
    return 0

"""`proxcgal replay`: step through a recording, or recompute it with another setting."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from proxcgal.cli.options import ControllerName, Flag, Settings, flat
from proxcgal.core.errors import ConfigError


@dataclass(frozen=True)
class ReplayOptions:
    """Scrub through a recording on a page with a time line, or step through it line by line.

    At a terminal it opens the page (one that other machines cannot reach), and prints its address.
    It prints lines instead, one per tick, then what it amounts to: with --no-view, --at, --every,
    --step, --controller or --set, and where its output goes into a file or another program.

    With --controller or --set, the commands are computed again from the recorded inputs, and
    compared with those of the recording; unchanged settings give the same, bit for bit.

    Examples:
      proxcgal replay out/demo/front_plane/wb.mcap
      proxcgal replay out/demo/front_plane/wb.mcap --every 50
      proxcgal replay out/demo/front_plane/wb.mcap --at 3.2
      proxcgal replay out/demo/front_plane/wb.mcap --step
      proxcgal replay out/demo/front_plane/wb.mcap --set controller.d_min=0.3
      proxcgal replay out/demo/front_plane/wb.mcap --controller sm --view
    """

    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
    """A recording that `proxcgal run` wrote (.mcap)."""
    at: Annotated[float | None, tyro.conf.arg(metavar="T", help_behavior_hint="")] = None
    """Show all of the tick at this time since the first [s], instead of a line per tick."""
    every: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="(default: 1)")] = (
        None
    )
    """Show every Nth tick only."""
    step: Flag = False
    """Wait for Enter after each line; q ends."""
    controller: Annotated[
        ControllerName | None,
        tyro.conf.arg(metavar="wb|sm|wb_known|wb_memory", help_behavior_hint=""),
    ] = None
    """Compute the commands of this controller from the recorded inputs."""
    set: Settings = ()
    """Compute the commands with other keys of the recorded scenario."""
    view: Flag = False
    """Open the page whatever else is given; with --controller or --set it shows both."""
    no_view: Flag = False
    """Print lines, at a terminal too."""
    host: Annotated[str, tyro.conf.arg(metavar="A")] = "127.0.0.1"
    """Address that the page listens on."""
    port: Annotated[int, tyro.conf.arg(metavar="N")] = 8080
    """Port that the page listens on; 0 takes any that is free."""
    token: Annotated[str | None, tyro.conf.arg(metavar="T", help_behavior_hint="")] = None
    """What the page must be shown; left out: none on this machine, a random one beyond it."""


def replay_command(options: ReplayOptions, command: str) -> int:
    """Prints the ticks asked for and the run's numbers, or serves the page until interrupted."""
    from proxcgal.recording.reader import read_recording
    from proxcgal.recording.stepping import step_through

    every = 1 if options.every is None else options.every
    if every < 1:
        raise ConfigError(f"--every {every}: must be 1 or more")
    if options.view and options.no_view:
        raise ConfigError("--view --no-view: a page or lines, not both")
    recording = read_recording(options.file)
    if recording.damage:
        print(f"proxcgal: {options.file}: damaged: {recording.damage}", file=sys.stderr)
    if not recording.ticks:
        raise ConfigError(f"{options.file}: holds no tick")
    changes = flat(options.set)
    if opens_page(options, terminal=sys.stdout.isatty()):
        from proxcgal.viewer.replay_page import view_recording

        view_recording(
            recording, options.controller, changes,
            host=options.host, port=options.port, token=options.token,
        )  # fmt: skip
    else:
        step_through(
            recording, options.controller, changes,
            at=options.at, every=every, wait=options.step,
        )  # fmt: skip
    return 0


def opens_page(options: ReplayOptions, *, terminal: bool) -> bool:
    """A page, or lines? At a terminal a page, unless an option asks for something of the lines."""
    lines = (
        options.no_view or options.step or options.at is not None or options.every is not None
        or options.controller is not None or flat(options.set)
    )  # fmt: skip
    return options.view or (terminal and not lines)

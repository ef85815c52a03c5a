"""`proxcgal replay`: step through a recording, or recompute it with another setting."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import tyro

from proxcgal.cli.options import ControllerName, Flag, Settings, flat
from proxcgal.core import modes
from proxcgal.core.errors import ConfigError

if TYPE_CHECKING:
    from proxcgal.evaluation.trial_log import TrialLog
    from proxcgal.recording.reader import Recording
    from proxcgal.sim.tick import Tick


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
    """Prints the ticks asked for and the run's numbers."""
    from proxcgal.recording.reader import read_recording
    from proxcgal.recording.replay import recorded_log

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
        return _view(options, recording, changes)
    again = options.controller is not None or bool(changes)
    row = None if options.at is None else _row_at(recording, options.at)
    shown = _recomputed(recording, options.controller, changes) if again else recording
    _print_header(shown)
    if row is not None:
        _show_tick(shown.ticks[row], float(shown.elapsed()[row]))
        return 0
    log = recorded_log(shown)
    _walk(_lines(log, shown.ticks, every), step=options.step)
    _print_summary(log)
    if again:
        _compare(recording, log)
    return 0


def opens_page(options: ReplayOptions, *, terminal: bool) -> bool:
    """A page, or lines? Whoever asks for nothing else at a terminal wants to look."""
    lines = (
        options.no_view or options.step or options.at is not None or options.every is not None
        or options.controller is not None or flat(options.set)
    )  # fmt: skip
    return options.view or (terminal and not lines)


def _view(options: ReplayOptions, recording: Recording, changes: Sequence[str]) -> int:
    """Serves the page until interrupted; prints its address."""
    import threading

    from proxcgal.cli.view import address, checked_token
    from proxcgal.viewer.access import close, serve
    from proxcgal.viewer.replay_page import HZ, ReplayPage, said
    from proxcgal.viewer.replayed import replayed

    token = checked_token(options.host, options.port, options.token)
    recorded = replayed(recording, HZ)
    again = None
    if options.controller is not None or changes:
        again = replayed(recording, HZ, options.controller, changes, ahead=True)
    words = said(recorded, again)
    server, gate = serve(
        options.host, options.port, label=f"proxcgal: {options.file.name}", token=token
    )
    page = ReplayPage(server, gate, recorded, again, words)
    try:
        print(words)
        print(address(options.host, server.get_port(), token), flush=True)
        if sys.stdout.isatty():
            print("Ctrl-C: end; with --no-view: lines here instead of the page", flush=True)
        threading.Event().wait()
    finally:
        page.close()
        close(server)
    return 0


def _recomputed(recording: Recording, controller: str | None, changes: Sequence[str]) -> Recording:
    """The recording as if its inputs had met this controller; the arm moves as recorded."""
    from proxcgal.recording.replay import Replay

    again = Replay(recording, controller, changes)
    ticks = tuple(again)
    settings = replace(
        recording.settings, controller=again.controller, scenario=again.setup.scenario
    )
    return replace(recording, ticks=ticks, settings=settings)


def _print_header(recording: Recording) -> None:
    settings = recording.settings
    print(
        f"{settings.scenario.name}, {settings.controller}, seed {settings.seed}: "
        f"{len(recording.ticks)} ticks, {recording.elapsed()[-1]:.2f} s"
        + ("" if settings.ticks == "all" else "; those with scans only, and so are the numbers")
    )


def _lines(log: TrialLog, ticks: Sequence[Tick], every: int) -> Iterator[str]:
    """A line a tick: distances in m, the link that avoidance moves, what was found."""
    width = max(map(len, log.control_link), default=0)
    yield (
        f"{'time':>7}  {'seen':>6}  {'true':>6}  {'act':>4}  {'goal':>6}  {'mode':<8}  "
        f"{'moves':<{width}}  findings"
    )
    for row in range(0, len(log.elapsed), every):
        found = ", ".join(dict.fromkeys(f.reason for f in ticks[row].result.findings))
        yield (
            f"{log.elapsed[row]:7.2f}  {_metres(log.seen_m[row])}  {_metres(log.true_m[row])}  "
            f"{log.activation[row]:4.2f}  {log.goal_error_m[row]:6.3f}  "
            f"{modes.NAMES[log.mode[row]]:<8}  {log.control_link[row]:<{width}}  {found}"
        ).rstrip()


def _walk(lines: Iterator[str], *, step: bool) -> None:
    """Prints the lines; with `step`, one for each Enter."""
    for row, line in enumerate(lines):
        print(line, end="" if step and row else "\n", flush=True)
        if step and row:
            try:
                answer = input("  ")
            except EOFError:
                print()
                return
            if answer.strip().lower() in ("q", "quit"):
                return


def _print_summary(log: TrialLog) -> None:
    from proxcgal.evaluation.metrics import static_summary, table

    print()
    print(table([static_summary([log])]))
    found = ", ".join(f"{reason} in {ticks} ticks" for reason, ticks in log.findings.items())
    print(f"findings: {found or 'none'}")


def _compare(recording: Recording, log: TrialLog) -> None:
    """How far the recomputed commands are from the recorded ones."""
    recorded = np.array([tick.result.qd for tick in recording.ticks])
    if np.array_equal(recorded, log.qd):
        print("commands: the same as recorded, bit for bit")
        return
    apart = np.abs(recorded - log.qd).max(axis=1)
    row = int(apart.argmax())
    print(
        f"commands: differ from the recorded ones in {np.count_nonzero(apart)} of {len(apart)} "
        f"ticks, most by {apart[row]:.4f} rad/s at {log.elapsed[row]:.2f} s; the arm moves as "
        "recorded"
    )


def _row_at(recording: Recording, time: float) -> int:
    """Row of the first tick at or after that time. Raises: ConfigError outside the recording."""
    times = recording.elapsed()
    last = float(times[-1])
    if not 0.0 <= time <= last:
        raise ConfigError(f"--at {time:g}: must be 0 to {last:g} s, which the recording holds")
    return int(np.searchsorted(times, time - 1e-9))


def _show_tick(tick: Tick, elapsed: float) -> None:
    """Everything of one tick, `elapsed` after the first [s]."""
    inputs, result, truth = tick.inputs, tick.result, tick.truth
    sensors = ", ".join(str(scan.sensor) for scan in inputs.scans)
    rows = [
        ("time", f"{elapsed:.4f} s{', late' if inputs.late else ''}"),
        *([("clock", f"{inputs.time:.4f} s")] if abs(inputs.time - elapsed) > 1e-3 else []),
        ("q", _vector(inputs.q)),
        ("goal", _vector(inputs.goal[:3, 3])),
        ("scans", sensors or ("known points" if inputs.known else "none")),
        ("cloud", f"{result.cloud_points} points"),
        ("seen", f"{_metres(result.seen).strip()} {result.link}"),
        ("true", f"{_metres(truth.distance).strip()} {truth.link}"),
        ("own links", _metres(truth.own).strip()),
        ("moves", result.control_link or "nothing"),
        ("mode", modes.NAMES[result.mode]),
        ("qd", _vector(result.qd)),
    ]
    for task in result.tasks:
        for name in ("rate", "activation", "residual"):
            rows.append((f"{task.name} {name}", _vector(getattr(task, name))))
    for found in result.findings:
        where = f" sensor {found.sensor}" if found.sensor >= 0 else ""
        where += f" zone {found.zone}" if found.zone >= 0 else ""
        where += f" {found.link}" if found.link else ""
        rows.append(("finding", f"{found.reason}{where}, {found.count} times"))
    width = max(len(name) for name, _ in rows)
    for name, value in rows:
        print(f"{name:<{width}}  {value}".rstrip())


def _metres(distance: float) -> str:
    return f"{distance:6.3f}" if np.isfinite(distance) else "  none"


def _vector(values: Iterable[float]) -> str:
    return " ".join(f"{value:.4f}" for value in values) or "none"

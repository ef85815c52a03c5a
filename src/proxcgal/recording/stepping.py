"""A recording in a terminal: a line a tick, all of one tick, and the run's numbers."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from proxcgal.core import modes
from proxcgal.core.errors import ConfigError
from proxcgal.evaluation.metrics import static_summary, table
from proxcgal.evaluation.trial_log import TrialLog
from proxcgal.recording.reader import Recording
from proxcgal.recording.replay import Replay, recorded_log
from proxcgal.sim.tick import Tick


def step_through(
    recording: Recording,
    controller: str | None = None,
    changes: Sequence[str] = (),
    *,
    at: float | None = None,
    every: int = 1,
    wait: bool = False,
) -> None:
    """Prints ticks and numbers of a recording; recomputed, where anything is changed.

    Args:
        recording: of a run, not empty.
        controller: instead of the recorded one.
        changes: `key.sub=value` on the recorded scenario.
        at: [s] since the first tick: prints all of that tick, and nothing else.
        every: prints each Nth tick.
        wait: for Enter after each line; q ends.

    Raises:
        ConfigError: a time outside of the recording, a bad change.
    """
    again = controller is not None or bool(changes)
    row = None if at is None else _row_at(recording, at)
    shown = _recomputed(recording, controller, changes) if again else recording
    _print_header(shown)
    if row is not None:
        _print_tick(shown.ticks[row], float(shown.elapsed()[row]))
        return
    log = recorded_log(shown)
    _print_lines(_lines(log, shown.ticks, every), wait=wait)
    print()
    print(table([static_summary([log])]))
    found = ", ".join(f"{reason} in {ticks} ticks" for reason, ticks in log.findings.items())
    print(f"findings: {found or 'none'}")
    if again:
        _compare(recording, log)


def _recomputed(recording: Recording, controller: str | None, changes: Sequence[str]) -> Recording:
    """The recording as if its inputs had met this controller; the arm moves as recorded."""
    again = Replay(recording, controller, changes)
    settings = replace(
        recording.settings, controller=again.controller, scenario=again.setup.scenario
    )
    return replace(recording, ticks=tuple(again), settings=settings)


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


def _print_lines(lines: Iterator[str], *, wait: bool) -> None:
    """Prints the lines; with `wait`, one for each Enter."""
    for row, line in enumerate(lines):
        print(line, end="" if wait and row else "\n", flush=True)
        if wait and row:
            try:
                answer = input("  ")
            except EOFError:
                print()
                return
            if answer.strip().lower() in ("q", "quit"):
                return


def _compare(recording: Recording, log: TrialLog) -> None:
    """Prints how far the recomputed commands are from the recorded ones."""
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


def _print_tick(tick: Tick, elapsed: float) -> None:
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
    rows += [
        (f"{task.name} {name}", _vector(getattr(task, name)))
        for task in result.tasks
        for name in ("rate", "activation", "residual")
    ]
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

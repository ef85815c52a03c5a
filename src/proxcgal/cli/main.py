"""The command `proxcgal`: arguments become a call, problems a line each."""

import difflib
import errno
import os
import shlex
import sys
import warnings
from collections.abc import Callable, Sequence
from importlib import import_module, metadata
from typing import Any

from proxcgal.core.errors import ProxError

HELP = """\
Whole-arm avoidance for robot arms from a few proximity sensors.

usage: proxcgal COMMAND ...

  run SCENARIO   simulate a scene with one or several controllers, write what happened
  demo           both static scenes with all controllers, one report
  campaign KIND  many trials, on this machine or on a cluster, and what they amount to
  coverage SCENARIO   what the sensors see of the space round the arm
  sweep          time both algorithms, literal and accelerated, over meshes and clouds
  view SCENARIO  a scene in the browser, live: drag the obstacle
  serve          take goals for the 12-joint robot over TCP, one JSON object a line
  replay FILE    step through a recording
  report DIR     write DIR/report.html from the results in DIR
  scenarios      the scenes there are
  robots         the robots there are; robots check FILE: what is understood of one

  --help         this text; `proxcgal COMMAND --help` tells a command's options
  --version      versions of proxcgal and of what its results depend on

examples:
  proxcgal run front_plane
  proxcgal run side_plane --controller wb sm --seed 3 --out out/side
  proxcgal run front_plane --set controller.d_min=0.25 simulation.dropout=0.1
  proxcgal run front_plane --robot my_arm.urdf --package-dir ~/robots
  proxcgal view front_plane
  proxcgal replay out/side/wb.mcap --every 50
  proxcgal sweep --quick
"""

#: Module that holds each command's options, `RunOptions`, and what it does, `run_command`.
COMMANDS = {
    "run": "proxcgal.cli.run",
    "demo": "proxcgal.cli.demo",
    "campaign": "proxcgal.cli.campaign",
    "coverage": "proxcgal.cli.coverage",
    "sweep": "proxcgal.cli.sweep",
    "view": "proxcgal.cli.view",
    "serve": "proxcgal.cli.serve",
    "replay": "proxcgal.cli.replay",
    "report": "proxcgal.cli.report",
    "scenarios": "proxcgal.cli.lists",
    "robots": "proxcgal.cli.robots",
}
OK, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command.

    Args:
        arguments: without the program's name; None takes the process's own.

    Returns:
        0 done, 1 failed on the way (the arm met itself), 2 a ProxError (bad input, a
        simulation that cannot go on) or a disk that is full, 130 interrupted.
    """
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    if not arguments:
        print(HELP, end="", file=sys.stderr)
        return BAD_INPUT
    command, rest = arguments[0], arguments[1:]
    if command in ("-h", "--help", "help"):
        print(HELP, end="")
        return OK
    if command in ("-V", "--version"):
        return guarded(_print_versions)
    if command not in COMMANDS:
        near = difflib.get_close_matches(command, COMMANDS, n=1)
        hint = f"; did you mean {near[0]}?" if near else ""
        _print_problems(f"command {command!r}: unknown{hint} There are: {', '.join(COMMANDS)}")
        return BAD_INPUT
    return call(command, rest)


def call(command: str, arguments: Sequence[str]) -> int:
    """Parses the options of one command and runs it; the exit code, as `main` has it."""
    try:
        options = parse_options(command, arguments)
    except SystemExit as end:  # help
        return int(end.code or 0)
    except ProxError as error:
        _print_problems(str(error))
        return BAD_INPUT
    run: Callable[[Any, str], int] = getattr(import_module(COMMANDS[command]), f"{command}_command")
    # The command as typed is for reports.
    return guarded(lambda: run(options, shlex.join(("proxcgal", command, *arguments))))


def parse_options(command: str, arguments: Sequence[str]) -> Any:
    """The options of one command. Raises: SystemExit after help; ConfigError, what is wrong."""
    from proxcgal.cli.parsing import parse_words

    options_type = getattr(import_module(COMMANDS[command]), f"{command.capitalize()}Options")
    return parse_words(options_type, f"proxcgal {command}", arguments)


def guarded(work: Callable[[], int]) -> int:
    """Runs `work`; problems become a line each on stderr and an exit code, never a traceback."""
    warnings.showwarning = _note
    try:
        return work()
    except ProxError as error:
        _print_problems(str(error))
        return BAD_INPUT
    except BrokenPipeError:  # the reader has ended, as in `proxcgal replay FILE | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OK
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        if full and not place:
            place = "standard output: "
        _print_problems(f"{place}{error.strerror or error}")
        return BAD_INPUT if full else FAILED
    except KeyboardInterrupt as stop:
        _print_problems("interrupted" + (f"; {stop}" if str(stop) else ""))
        return INTERRUPTED


def _note(message: Warning | str, *_: object, **__: object) -> None:
    """A warning as one line, without the place in our code that it came from."""
    print(f"proxcgal: note: {message}", file=sys.stderr)


def _print_problems(message: str) -> None:
    for line in message.splitlines() or [""]:
        print(f"proxcgal: {line}", file=sys.stderr)


def _print_versions() -> int:
    from proxcgal.core.provenance import versions

    print(f"proxcgal {metadata.version('proxcgal')}")
    for name, version in versions().items():
        if name != "proxcgal":
            print(f"  {name} {version}")
    return OK

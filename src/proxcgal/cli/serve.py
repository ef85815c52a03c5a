"""`proxcgal serve`: the action server for other programs, one JSON object a line over TCP."""

import ipaddress
from dataclasses import dataclass
from typing import Annotated, Literal

import tyro

from proxcgal.cli.options import Flag, Settings, flat
from proxcgal.core.errors import ConfigError


@dataclass(frozen=True)
class ServeOptions:
    """Take goals for the 12-joint robot: one JSON object a line, over TCP, on loopback.

    A goal ([m], [rad]; init, rpy and frame may be left out; frame may be "end_effector"):

      {"op": "goal", "init": "free", "translation": [3.0, 0.3, 1.05], "rpy": [0, 1.57, 0]}

    Its end, which any client may ask for, and where the arm stands:

      {"op": "cancel", "goal": 1}
      {"op": "state"}

    Answers: accepted, refused (with the reason), cancelling, state; then feedback ten times a
    second, and one result for each goal: succeeded, aborted or cancelled, with the reason.

    Examples:
      proxcgal serve
      proxcgal serve --scenario joint_gate --port 7012 --second refuse
      proxcgal serve --set controller.tasks='["thesis"]'
    """

    port: Annotated[int, tyro.conf.arg(metavar="N")] = 7012
    """To listen on; 0 takes any that is free."""
    host: Annotated[str, tyro.conf.arg(metavar="ADDRESS")] = "127.0.0.1"
    """To listen on; anything but loopback needs --allow-remote."""
    allow_remote: Flag = False
    """Let other machines in: there is no password, whoever reaches the port moves the arm."""
    scenario: Annotated[str, tyro.conf.arg(metavar="NAME|PATH")] = "joint_free"
    """Of kind `joint`: robot, obstacles, tasks, configurations."""
    second: Literal["preempt", "refuse"] = "preempt"
    """What a goal does while another is executed."""
    set: Settings = ()
    """Change keys of the scenario, values as in TOML."""
    quiet: Flag = False
    """No word on stderr."""


def serve_command(options: ServeOptions, command: str) -> int:
    """Serves until interrupted."""
    from proxcgal.core.progress import announce
    from proxcgal.server.joint_server import JointRobotServer
    from proxcgal.server.tcp_server import serve_until_stopped

    _check_address(options)
    announce("setting up (a robot's first time takes a while)", quiet=options.quiet)
    with JointRobotServer(options.scenario, flat(options.set), second=options.second) as robot:
        serve_until_stopped(robot, options.host, options.port, quiet=options.quiet)
    return 0


def _check_address(options: ServeOptions) -> None:
    if not 0 <= options.port <= 65535:
        raise ConfigError(f"--port {options.port}: must be 0 to 65535")
    try:
        loopback = options.host == "localhost" or ipaddress.ip_address(options.host).is_loopback
    except ValueError:
        loopback = False
    if not (loopback or options.allow_remote):
        raise ConfigError(
            f"--host {options.host}: not a loopback address; --allow-remote lets other machines in"
        )

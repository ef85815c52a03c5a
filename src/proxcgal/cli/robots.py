"""`proxcgal robots`: what there is, and what is understood of a file."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from proxcgal.cli.options import Flag, Folders, Settings, flat, xacro_arguments
from proxcgal.core.errors import ConfigError


@dataclass(frozen=True)
class RobotsOptions:
    """The built-in robots, a line each; or what is understood of a file.

    robots check FILE reads a robot as `run --robot FILE` does, and prints its tree, limits and
    sizes and what looks like a mistake. It draws every link and the posture in the middle of the
    limits to DIR/NAME.png: look at it before the robot is trusted.

    Examples:
      proxcgal robots
      proxcgal robots check my_arm.urdf --package-dir ~/robots
      proxcgal robots check my_arm.xacro --xacro-arg ur_type=ur10e name=arm
    """

    action: Annotated[
        Literal["list", "check"], tyro.conf.Positional, tyro.conf.arg(metavar="list|check")
    ] = "list"
    """What to do."""
    file: Annotated[
        Path | None, tyro.conf.Positional, tyro.conf.arg(metavar="FILE", help_behavior_hint="")
    ] = None
    """To check: .urdf, .xacro, .xml (URDF or MJCF) or .toml, or the name of a built-in robot."""
    package_dir: Folders = ()
    """Where package:// paths of the file are looked up."""
    xacro_arg: Settings = ()
    """Arguments of a xacro: name=value"""
    out: Annotated[
        Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(default: out/robots)")
    ] = None
    """Where the picture goes."""
    no_picture: Flag = False
    """Print only."""


def robots_command(options: RobotsOptions, command: str) -> int:
    """Lists the robots, or checks one."""
    from proxcgal.cli.lists import print_columns
    from proxcgal.models.builtin import list_robots

    if options.action == "list":
        if options.file is not None:
            raise ConfigError(f"robots list {options.file}: takes no file; robots check does")
        print_columns(list_robots())
        return 0
    if options.file is None:
        raise ConfigError("robots check: a file is needed")
    _check(options, options.file)
    return 0


def _check(options: RobotsOptions, file: Path) -> None:
    from proxcgal.core.files import write_bytes
    from proxcgal.models.robots import describe_robot
    from proxcgal.models.understanding import understanding
    from proxcgal.study.plotting import png
    from proxcgal.study.robot_picture import robot_figure

    description = describe_robot(
        file.expanduser(),
        flat(options.package_dir, "--package-dir"),
        xacro_args=xacro_arguments(flat(options.xacro_arg, "--xacro-arg")),
    )
    print(understanding(description))
    if options.no_picture:
        return
    folder = options.out or Path("out/robots")
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{file.stem}.png"
    write_bytes(path, png(robot_figure(description)))
    print(f"\npicture: {path}")

"""`proxcgal run`: simulate a scene with one or several controllers."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from proxcgal.cli.options import (
    ControllerName,
    Flag,
    Folders,
    Number,
    Settings,
    checked_workers,
    flat,
    xacro_arguments,
)
from proxcgal.core.errors import ConfigError


@dataclass(frozen=True)
class RunOptions:
    """Simulate a scene with one or several controllers, and write what happened.

    Writes summary.json, scenario.toml (the resolved scenario), figures, a moving picture, one
    recording per controller and report.html to DIR.

    Examples:
      proxcgal run front_plane
      proxcgal run side_plane --controller wb sm --seed 3 --out out/side
      proxcgal run front_plane --set controller.d_min=0.25 simulation.dropout=0.1
      proxcgal run walkthrough_overspeed
      proxcgal run joint_gate --set controller.off='["minimum_altitude"]'
      proxcgal run hri_task1 --subject 7 --controller wb sm
      proxcgal run my_scene.toml --robot my_arm.urdf --package-dir ~/robots
    """

    scenario: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENARIO")]
    """A name that `proxcgal scenarios` lists, or a path to a TOML file."""
    controller: Annotated[
        tuple[ControllerName, ...] | None,
        tyro.conf.arg(metavar="wb|sm|wb_known|wb_memory ...", help_behavior_hint=""),
    ] = None
    """wb: the whole body avoids. sm: only the sensors' mounting points do, the baseline.
    wb_known: wb on points of the scene itself, the ceiling. wb_memory: wb that remembers what left
    the sensors' view. Left out: wb sm wb_known; of a scene of kind `joint` wb_known, or wb where
    its perception is sensed."""
    robot: Annotated[str | None, tyro.conf.arg(metavar="NAME|PATH", help_behavior_hint="")] = None
    """A name that `proxcgal robots` lists, or a .urdf, .xacro or .xml file; instead of the
    scenario's."""
    subject: Number = None
    """Which virtual subject works there, any number from 1: stature, arms, speeds, reactions and
    stance are drawn from it and operator.draw. Of scenarios with an operator."""
    package_dir: Folders = ()
    """Where package:// paths of the robot's file are looked up."""
    xacro_arg: Settings = ()
    """Arguments of the robot's file where that is a xacro: name=value"""
    tool: Annotated[str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="")] = None
    """The robot's tool frame, where its file leaves that open."""
    seed: Number = None
    """Fixes every random draw; instead of the scenario's."""
    set: Settings = ()
    """Change keys of the scenario, values as in TOML: controller.d_min=0.25"""
    out: Annotated[
        Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(default: out/SCENARIO)")
    ] = None
    """Where results go; an earlier run's files there are replaced."""
    workers: Number = None
    """Processes that simulate; left out: one a processor."""
    no_picture: Flag = False
    """Leave the moving picture out; runs of kind `joint` draw none."""
    quiet: Flag = False
    """No progress on stderr."""


def run_command(options: RunOptions, command: str) -> int:
    """Runs the trials; prints the table and the report's path."""
    from proxcgal.report.write_report import write_report
    from proxcgal.scenario.loading import load_scenario
    from proxcgal.study.runs.scenes import run_scenario

    if options.controller == ():
        raise ConfigError(
            "--controller: none given, at least one of wb, sm, wb_known, wb_memory is needed"
        )
    workers = checked_workers(options.workers)
    for name, number, least in (("--seed", options.seed, 0), ("--subject", options.subject, 1)):
        if number is not None and not least <= number < 2**63:
            raise ConfigError(f"{name} {number}: must be {least} to {2**63 - 1}")
    _check_subject(options)
    scenario = load_scenario(options.scenario, overrides(options))
    if scenario.kind == "walkthrough" and options.controller:
        raise ConfigError(
            f"--controller {' '.join(options.controller)}: {options.scenario} has kind = "
            '"walkthrough", where a hand guides the arm: no controllers to choose from'
        )
    folder = options.out or Path("out") / scenario.name
    failed = run_scenario(
        scenario, options.controller or (), folder, command, workers=workers,
        pictures=not options.no_picture, quiet=options.quiet,
    )  # fmt: skip
    print(write_report(folder))
    return 1 if failed else 0


def _check_subject(options: RunOptions) -> None:
    """Raises: ConfigError: a subject for a scenario without a virtual operator."""
    from proxcgal.scenario.hri_scenario import HriScenario
    from proxcgal.scenario.loading import load_scenario

    if options.subject is None:
        return
    base = load_scenario(options.scenario, flat(options.set))
    if not isinstance(base, HriScenario):
        raise ConfigError(
            f'--subject {options.subject}: {options.scenario} has kind = "{base.kind}" and no '
            'operator; scenarios of kind = "hri" have one'
        )
    if base.operator.recording is not None:
        raise ConfigError(
            f"--subject {options.subject}: operator.recording = {base.operator.recording}: its "
            "person is always the same; leave one of the two out"
        )


def overrides(options: RunOptions) -> list[str]:
    """Assignments of all options that change the scenario; --set comes last and wins."""
    from proxcgal.models.formats.paths import is_robot_file

    changes = []
    if options.robot is not None:
        path = Path(options.robot).expanduser()
        robot = str(path.absolute()) if is_robot_file(path) else options.robot
        changes.append(f"robot={json.dumps(robot)}")
    if folders := [
        str(path.expanduser().absolute()) for path in flat(options.package_dir, "--package-dir")
    ]:
        changes.append("package_dirs=" + json.dumps(folders))
    if arguments := flat(options.xacro_arg, "--xacro-arg"):
        xacro_arguments(arguments)
        changes.append("xacro_args=" + json.dumps(arguments))
    if options.tool is not None:
        changes.append(f"tool={json.dumps(options.tool)}")
    numbers = {"operator.subject": options.subject, "seed": options.seed}
    changes += [f"{key}={number}" for key, number in numbers.items() if number is not None]
    return changes + flat(options.set)

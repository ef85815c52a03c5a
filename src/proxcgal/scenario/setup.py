"""From a scenario to what runs: robot, sensors, controller settings, start and goal."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from proxcgal import _core
from proxcgal.core import transforms
from proxcgal.core.errors import ConfigError
from proxcgal.core.typing import Array
from proxcgal.models import macro_micro
from proxcgal.models.robots import Robot, load_robot
from proxcgal.models.skins import ring_skin
from proxcgal.scenario.scenario import CONTROLLERS, Scenario
from proxcgal.scene.obstacles import KnownCloud, Scene


@dataclass(frozen=True, kw_only=True)
class Setup:
    """Everything of a scenario that does not change while it runs."""

    scenario: Scenario
    robot: Robot
    skin: _core.Skin
    q0: Array  #: (n_q,)
    goals: tuple[Array, ...]  #: (4, 4) T_WT each, in the order of their turn
    scene: Scene  #: what sensors see and known points lie on
    measured: Scene  #: what true distances run to
    drawn: Scene  #: all that is there

    @classmethod
    def of(cls, scenario: Scenario, robot: Robot | None = None) -> Self:
        """Loads the robot, unless one is given, and puts the sensors on it.

        Raises:
            ConfigError: what of the scenario does not fit the robot.
            ModelError: the robot's description.
        """
        robot = robot or make_robot(scenario)
        require_fit(scenario, robot)
        q0 = np.array(scenario.start()[1], np.float64)
        return cls(
            scenario=scenario, robot=robot, skin=make_skin(scenario, robot), q0=q0,
            goals=_goals(scenario, robot, q0), scene=scenario.scene(),
            measured=scenario.measured(), drawn=scenario.drawn(),
        )  # fmt: skip

    @property
    def goal(self) -> Array:
        """(4, 4) T_WT, the first of them."""
        return self.goals[0]

    def uses_known_points(self, controller: str) -> bool:
        """Does this controller get points of the scene itself instead of scans?"""
        return controller == "wb_known" or self.scenario.perception == "known"

    def known_cloud(self, spacing: float | None = None) -> KnownCloud:
        """Points of the scene's own surfaces, wherever those are.

        Args:
            spacing: they are at most this far apart [m]; left out: that of the scenario.
        """
        return KnownCloud(self.scene, spacing or self.scenario.simulation.known_spacing)

    def make_controller(self, controller: str, known_points: int = 0) -> _core.Controller:
        """The controller of that name, with room for that many known points.

        Raises:
            ConfigError: an unknown name, a setting out of the core's bounds.
        """
        if controller not in CONTROLLERS:
            raise ConfigError(f"controller {controller!r}: there are {', '.join(CONTROLLERS)}")
        settings = self.scenario.controller
        remembers, tracks = controller == "wb_memory", controller in settings.motion.controllers
        motion = {k: v for k, v in settings.motion.model_dump().items() if k != "controllers"}
        config = _core.ControllerConfig(
            control_point="sensor" if controller == "sm" else "whole_body",
            tasks=self.make_tasks(),
            filter=_core.FilterConfig(**settings.filter.model_dump()),
            solver=_core.SolverConfig(**settings.solver.model_dump()),
            limit=_core.LimitConfig(
                **settings.limit_settings.model_dump(), distances=settings.limit == "full"
            ),
            monitor=_core.MonitorConfig(**settings.monitor.model_dump()),
            period=1.0 / self.scenario.simulation.control_hz,
            min_row_norm=settings.min_row_norm,
            avoid_links=list(settings.avoid_links),
            method=settings.method,
            max_points=max(known_points, 1),
            memory=_core.MemoryConfig(**settings.memory.model_dump()) if remembers else None,
            motion=_core.MotionConfig(**motion) if tracks else None,
        )
        return _core.Controller(self.robot, self.skin, config)

    def make_tasks(self) -> list[Any]:
        """The scenario's tasks, in order of priority."""
        return [self._task(name) for name in self.scenario.controller.levels]

    def _task(self, name: str) -> Any:
        """One level's settings for the core. Raises: ConfigError: two arms that are not there."""
        settings = self.scenario.controller
        match name:
            case "self_collision":
                return _core.SelfCollision(
                    **settings.self_collision.model_dump(),
                    pairs=macro_micro.watched_pairs(
                        self.robot, settings.macro_joints, settings.self_collision.d_min
                    ),
                )
            case "manipulability_macro" | "manipulability_micro":
                arm = name.rpartition("_")[2]
                first, joints = macro_micro.part(self.robot, settings.macro_joints, arm)
                return _core.Manipulability(
                    **settings.arm_manipulability.model_dump(),
                    first_joint=first,
                    joints=joints,
                    unit=macro_micro.largest_manipulability(self.robot, first, joints),
                )
            case "manipulability":
                return _core.Manipulability(**settings.manipulability.model_dump())
            case "avoidance":
                return _core.Avoidance(
                    d_min=settings.d_min,
                    buffer=settings.buffer,
                    gain=settings.avoid_gain,
                    nearest=settings.nearest,
                )
            case "joint_limits":
                return _core.JointLimits(**settings.joint_limits.model_dump())
            case "minimum_altitude":
                return _core.MinimumAltitude(**settings.minimum_altitude.model_dump())
        return _core.Reach(  # of all six rows, or those of the position or the orientation
            gain=settings.reach_gain,
            max_linear=settings.max_linear,
            max_angular=settings.max_angular,
            rows=name.removeprefix("reach").removeprefix("_") or "both",
        )

    def mesh_hashes(self) -> dict[str, str]:
        """SHA-256 of each link's meshes, as `LINK full` and `LINK control`."""
        return {
            f"{link} {kind}": digest
            for link, kinds in self.robot.mesh_hashes.items()
            for kind, digest in kinds.items()
        }


def make_robot(scenario: Scenario) -> Robot:
    """The scenario's robot. Raises: ConfigError, ModelError."""
    return load_robot(
        scenario.robot,
        package_dirs=scenario.package_dirs,
        vertices_per_link=scenario.vertices_per_link or None,
        tool=scenario.tool,
        xacro_args=_xacro_args(scenario),
        speed_limits=scenario.limits.speed,
        acceleration_limits=scenario.limits.acceleration,
    )


def _xacro_args(scenario: Scenario) -> dict[str, str]:
    """By name. Raises: ConfigError: one is no name=value, or comes twice."""
    found: dict[str, str] = {}
    for word in scenario.xacro_args:
        name, equals, value = word.partition("=")
        if not equals or not name or name in found:
            raise ConfigError(f"xacro_args: {word!r}; each name once, as name=value, is needed")
        found[name] = value
    return found


def make_skin(scenario: Scenario, robot: Robot) -> _core.Skin:
    """The scenario's sensors on a robot that `require_fit` has checked."""
    model = _core.SensorModel(**scenario.skin.sensor.model_dump())
    skin = _core.Skin([], model)
    for ring in scenario.skin.fitted:
        height: dict[str, Any] = {} if ring.standoff is None else {"standoff": ring.standoff}
        skin = skin + ring_skin(
            robot, ring.link, ring.at, ring.sensors, model=model, phase=ring.phase,
            axis=ring.axis, **height,
        )  # fmt: skip
    return skin


def require_fit(scenario: Scenario, robot: Robot) -> None:
    """Raises: ConfigError, all that the scenario says of another robot than this, a line each."""
    key, values = scenario.start()
    named = {f"skin.rings.{row}.link": ring.link for row, ring in enumerate(scenario.skin.fitted)}
    avoided = scenario.controller.avoid_links
    named |= {f"controller.avoid_links.{row}": link for row, link in enumerate(avoided)}
    problems = posture_problems(robot, values, key) + [
        f"{place} = {link!r}: {robot.name} has the links {', '.join(robot.link_names)}"
        for place, link in named.items()
        if link not in robot.link_names
    ]
    if problems:
        raise ConfigError("\n".join(f"scenario {scenario.name}: {line}" for line in problems))


def posture_problems(robot: Robot, q: Sequence[float], key: str) -> list[str]:
    """Why a robot cannot stand like this, a line each: joint, value, limits."""
    if len(q) != robot.n_q:
        return [
            f"{key} has {len(q)} values: {robot.name} has {robot.n_q} joints, "
            f"{', '.join(robot.joint_names)}"
        ]
    limits = zip(q, robot.joint_names, robot.q_min, robot.q_max, strict=True)
    return [
        f"{key}.{row} = {value:g}: {joint} of {robot.name} goes from {low:g} to {high:g}"
        for row, (value, joint, low, high) in enumerate(limits)
        if not low <= value <= high
    ]


def _goals(scenario: Scenario, robot: Robot, q0: Array) -> tuple[Array, ...]:
    start, goal = np.array(robot.tool_pose(q0)), scenario.goal
    if goal.offset is not None:
        places = [start[:3, 3] + goal.offset]
    else:
        places = [np.array(place) for place in goal.waypoints or [goal.position]]
    goals = []
    for place in places:
        T_WT = start.copy()
        T_WT[:3, 3] = place
        if goal.rpy is not None:
            T_WT[:3, :3] = transforms.rotation_from_rpy(goal.rpy)
        goals.append(T_WT)
    return tuple(goals)

"""From a walk-through scenario to what runs: arm, guard, hand guiding, start."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np

from proxcgal import _core
from proxcgal.core.errors import ConfigError
from proxcgal.core.typing import Array
from proxcgal.models.builtin import ga_ol
from proxcgal.models.formats.capsule_robot import CapsuleRobot, read_capsule_robot
from proxcgal.models.robots import Robot, load_robot
from proxcgal.scenario.walkthrough_scenario import WalkScenario
from proxcgal.sim.physics import Physics

PERIOD = 0.001  #: [s] of the guard's, the guiding's and the physics' cycle, [WT] section 3


@dataclass(frozen=True)
class WalkSetup:
    """Everything of a walk-through that does not change while it runs."""

    scenario: WalkScenario
    robot: Robot
    arm: CapsuleRobot  #: the same robot, with weights and brakes
    q0: Array  #: (n_q,)

    @classmethod
    def of(cls, scenario: WalkScenario, robot: Robot | None = None) -> Self:
        """Loads the robot, unless one is given.

        Raises:
            ConfigError: what of the scenario does not fit the robot; a guard that contradicts
                itself.
            ModelError: the robot's description.
        """
        arm = _arm(scenario)
        robot = robot or load_robot(
            scenario.robot, vertices_per_link=scenario.vertices_per_link or None
        )
        q0 = np.array(scenario.q0, np.float64)
        if len(q0) != robot.n_q or ((q0 < robot.q_min) | (q0 > robot.q_max)).any():
            raise ConfigError(
                f"scenario {scenario.name}: q0 = {list(scenario.q0)}: {robot.name} has the joints "
                f"{', '.join(robot.joint_names)}, from {_listed(robot.q_min)} to "
                f"{_listed(robot.q_max)} rad"
            )
        setup = cls(scenario, robot, arm, q0)
        setup.make_guard()
        setup.make_guide()
        setup.make_physics()  # fails before anything is written
        return setup

    def make_guard(self) -> _core.Guard:
        """The guard. Raises: ConfigError: out of bounds, or contradictions not accepted."""
        try:
            return _core.Guard(self.robot, self._guard_config())
        except ConfigError as error:
            name = self.scenario.name
            lines = [f"scenario {name}: guard: {line}" for line in str(error).splitlines()]
            raise ConfigError("\n".join(lines)) from None

    def make_guide(self) -> _core.HandGuide:
        """Hand guiding, its commands a share of what the guard lets pass. Raises: ConfigError."""
        return _core.HandGuide(
            self.robot,
            admittance=_core.AdmittanceConfig(**self.scenario.admittance.model_dump()),
            qdd_max=self.scenario.arm.command_share * self.bounds.qdd_bounds,
            period=PERIOD,
        )

    def make_physics(self, q: Array | None = None) -> Physics:
        """The arm with its weight and brakes, at rest."""
        keys = self.scenario.arm
        return Physics(
            self.arm, self.q0 if q is None else q, period=PERIOD, payload=keys.payload,
            brake_scale=keys.brake_scale, human=self.scenario.guard.human,
        )  # fmt: skip

    @cached_property
    def bounds(self) -> _core.Guard:
        """A guard to ask for its bounds and lists; none that runs."""
        return self.make_guard()

    @cached_property
    def monitored_pairs(self) -> tuple[str, ...]:
        """Links whose distance to the operator counts."""
        return tuple(self.bounds.monitored_pairs)

    @cached_property
    def monitored_ends(self) -> tuple[tuple[str, Array], ...]:
        """Links whose far end's velocity counts, and that end in the link's frame [m]."""
        ends = {link.name: np.array(link.end) for link in self.arm.links}
        return tuple((name, ends[name]) for name in self.bounds.monitored_ends)

    def slow(self) -> WalkSetup:
        """The same under the hand-guiding rules; what no longer needs accepting is not accepted."""
        slow = self.scenario.slow()
        bare = slow.guard.model_copy(update={"accept": ()})
        scenario = slow.model_copy(update={"guard": bare})
        found = _core.guard_contradictions(
            self.robot, WalkSetup(scenario, self.robot, self.arm, self.q0)._guard_config()
        )
        accept = tuple(item for item, _ in found if item in slow.guard.accept)
        guard = slow.guard.model_copy(update={"accept": accept})
        return WalkSetup.of(slow.model_copy(update={"guard": guard}), self.robot)

    def notes(self) -> list[str]:
        """Lines for a user at the start: monitored pairs, what was accepted, both distances."""
        guard, keys = self.bounds, self.scenario.guard
        return [
            f"guard: distance to the operator: {', '.join(guard.monitored_pairs)}; "
            f"velocity: {', '.join(guard.monitored_ends)}",
            *(f"guard: accepted {item}: {text}" for item, text in guard.accepted),
            f"guard: min_distance = {keys.min_distance:g} m; the separation distance of ISO/TS "
            f"15066 would be {guard.protective_distance:.2f} m",
        ]

    def _guard_config(self) -> _core.GuardConfig:
        keys = self.scenario.guard
        return _core.GuardConfig(
            capsules=self.arm.capsules(), q_reference=np.array(keys.q_reference),
            tcp_speed=keys.tcp_speed, stop_time=keys.stop_time, rest_speed=keys.rest_speed,
            period=PERIOD, max_gap=keys.max_gap, min_distance=keys.min_distance,
            max_velocity=keys.max_velocity, pairs=list(keys.pairs), ends=list(keys.ends),
            human_radius=keys.human.radius, human_height=keys.human.height,
            human_offset=keys.human.offset, subtract_human=keys.subtract_human,
            iso=_core.IsoSeparation(**keys.iso.model_dump()), accept=list(keys.accept),
        )  # fmt: skip


def _arm(scenario: WalkScenario) -> CapsuleRobot:
    """The robot with its weights. Raises: ConfigError: one that is no list of capsules."""
    if scenario.robot == "ga_ol":
        return ga_ol()
    if Path(scenario.robot).suffix.lower() == ".toml":
        return read_capsule_robot(Path(scenario.robot))
    raise ConfigError(
        f"scenario {scenario.name}: robot = {scenario.robot!r}: a walk-through is simulated with "
        "weight and brakes: 'ga_ol', or a path to a .toml list of capsules"
    )


def _listed(values: Array) -> str:
    return "[" + ", ".join(f"{value:g}" for value in values) + "]"

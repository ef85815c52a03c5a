"""A walk-through without end, driven by a page: a user pulls the tool by hand.

Cycle by cycle the arm of every run: guard, hand guiding, weight and brakes.
"""

import time as clock
from dataclasses import dataclass
from typing import Self

import numpy as np

from proxcgal import _core
from proxcgal.core.transforms import pose
from proxcgal.core.typing import Array
from proxcgal.scenario.walkthrough_scenario import WalkScenario
from proxcgal.sim.moment import Posed
from proxcgal.trial.walkthrough.guarded_arm import GuardedArm
from proxcgal.trial.walkthrough.operator_hand import HAND, InteractiveHand
from proxcgal.trial.walkthrough.setup import PERIOD, WalkSetup

CYCLES = 10  #: of the guard, in one step
#: Units of what the safety functions find.
UNITS = {
    "tcp_speed": "m/s", "joint_speed": "rad/s", "joint_acceleration": "rad/s^2", "distance": "m",
    "relative_velocity": "m/s", "cycle": "s",
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Extremes:
    """What the guard found at its worst, in the cycles since it was asked last."""

    distance: float  #: [m] least of the monitored pairs
    protective: float  #: [m] most that ISO/TS 15066 would ask for
    tcp_speed: float  #: [m/s]
    velocity: float  #: [m/s] most towards the operator
    speed_ratio: float  #: largest |qd| / qd_UB
    acceleration_ratio: float  #: largest |qdd| / qdd_UB

    def with_cycle(self, out: _core.GuardOutput) -> Self:
        """One cycle more."""
        return type(self)(
            distance=min(self.distance, out.distance),
            protective=max(self.protective, out.protective_distance),
            tcp_speed=max(self.tcp_speed, out.tcp_speed),
            velocity=max(self.velocity, out.velocity),
            speed_ratio=max(self.speed_ratio, out.speed_ratio),
            acceleration_ratio=max(self.acceleration_ratio, out.acceleration_ratio),
        )


_NOTHING = Extremes(
    distance=np.inf, protective=0.0, tcp_speed=0.0, velocity=-np.inf, speed_ratio=0.0,
    acceleration_ratio=0.0,
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WalkMoment(Posed):
    """What a moment of the cell looks like; the arrow goes from the tool to the hand that holds."""

    state: str  #: of the guard: 'off', 'on', 'stopping'
    trips: int  #: so far
    trip: str  #: the last one as text, "" before the first
    violated: tuple[str, ...]  #: safety functions, in the last cycle
    overrun: bool  #: not at rest in the declared time: it can't be switched on any more
    refused: str  #: why switching on was refused last, "" where it was not
    stop_time: float  #: [s] of the last stop
    force: float  #: [N] of the hand
    worst: Extremes  #: since the last moment


class WalkTrial:
    """One cell, as `LiveTrial` is one scene. Torque is off until a user switches it on."""

    def __init__(self, scenario: WalkScenario, setup: WalkSetup | None = None) -> None:
        """Args: the setup is the scenario's, where it is made already.

        Raises:
            ConfigError: what does not fit, a guard that contradicts itself.
            ModelError: the robot's description.
        """
        self.setup = setup or WalkSetup.of(scenario)
        self._arm = GuardedArm(self.setup)
        self._grip = InteractiveHand(scenario.hand, PERIOD)
        self._nothing = np.zeros(6)
        self._cycle = 1
        self._pressed = False
        self._refused = ""
        self._force = 0.0
        self._worst = _NOTHING
        self.cpu_us = 0.0  #: of the thread, a cycle, in the last step
        self._out = self._arm.watch(0.0, False)
        self._arm.move(self._nothing, False)

    @property
    def period(self) -> float:
        """[s] of one step."""
        return CYCLES * PERIOD

    @property
    def elapsed(self) -> float:
        """[s] simulated."""
        return self._cycle * PERIOD

    @property
    def stopped(self) -> bool:
        """Has a stop taken longer than declared? No request of a user leads out of it."""
        return bool(self._out.overrun)

    def again(self) -> Self:
        """Another one, the arm at its start, without torque."""
        return type(self)(self.setup.scenario, self.setup)

    def enable(self) -> None:
        """Presses the guard's reset; whether the torque comes back is for the safety logic."""
        self._pressed = True

    def move(self, name: str, wanted: Array) -> None:
        """Says where the hand at the tool is to go, (4, 4); other names are passed over.

        A hand takes hold of an arm with torque only.
        """
        if name == HAND and self._out.torque:
            self._grip.move(self._tool(), wanted)

    def release(self) -> None:
        """The hand lets go."""
        self._grip.let_go()

    def step(self) -> None:
        """`CYCLES` cycles, as the run's own. Raises: SimulationError: MuJoCo warned."""
        start = clock.thread_time_ns()
        for _ in range(CYCLES):
            self._one()
        self.cpu_us = (clock.thread_time_ns() - start) / (1000.0 * CYCLES)

    def moment(self) -> WalkMoment:
        """What there is to see now; the worst of the cycles since it was asked last."""
        out, physics, robot = self._out, self._arm.physics, self.setup.robot
        worst, self._worst = self._worst, _NOTHING
        if worst is _NOTHING:
            worst = _NOTHING.with_cycle(out)
        tool, held = self._tool(), self._grip.pose
        hand = tool if held is None else held
        return WalkMoment(
            elapsed=self.elapsed, q=np.array(physics.q),
            links_W=np.asarray(robot.link_poses(np.array(physics.q))),
            solids_W=self.operator_W()[None], goal_W=None, hand_W=hand, gripped=held is not None,
            control_W=None if held is None else tuple(tool[:3, 3]),
            obstacle_W=None if held is None else tuple(hand[:3, 3]),
            state=out.state, trips=out.trips, trip=self._words(), violated=tuple(out.violated),
            overrun=out.overrun, refused=self._refused, stop_time=out.stop_time,
            force=self._force, worst=worst,
        )  # fmt: skip

    def operator_W(self) -> Array:  # noqa: N802  a frame's suffix
        """(4, 4) of the operator's capsule, which rides on the tool and stands upright."""
        physics, offset = self._arm.physics, self.setup.scenario.guard.human.offset
        return pose(tuple(physics.tool_W + physics.tool_R @ np.array(offset)))

    def _one(self) -> None:
        physics, grip = self._arm.physics, self._grip
        pressed, self._pressed = self._pressed, False
        was_on = self._out.torque
        self._out = out = self._arm.watch(self._cycle * PERIOD, pressed)
        self._worst = self._worst.with_cycle(out)
        if pressed:
            self._refused = self._reason() if out.reset_refused else ""
        force = self._nothing
        if grip.pose is not None:
            force = grip.force(physics.tool_W, physics.tool_R, physics.tool_twist())
            if not out.torque:
                grip.feel_stop()
        if out.torque and not was_on:
            self._refused = ""
        self._force = float(np.linalg.norm(force[:3]))
        self._arm.move(force, grip.pose is not None)
        self._cycle += 1

    def _reason(self) -> str:
        """Why the safety logic did not switch on."""
        out = self._out
        if out.overrun:
            return "a stop took longer than declared"
        if out.violated:
            return f"still violated: {', '.join(out.violated)}"
        return "the arm is not at rest"

    def _words(self) -> str:
        """The last trip: function, value and limit with units, whose, and when."""
        if not self._out.trips:
            return ""
        trip = self._out.trip
        unit = UNITS.get(trip.function, "")
        return (
            f"{trip.function} {trip.value:.3f} {unit}, allowed {trip.limit:.3f} {unit}, "
            f"at {trip.time:.3f} s"
        )

    def _tool(self) -> Array:
        T_WT = np.eye(4)
        T_WT[:3, :3], T_WT[:3, 3] = self._arm.physics.tool_R, self._arm.physics.tool_W
        return T_WT

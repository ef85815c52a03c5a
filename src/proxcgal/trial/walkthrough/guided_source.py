"""A source of tick inputs: a hand guides the arm that its sensors keep away from obstacles."""

from collections.abc import Sequence
from dataclasses import replace
from typing import cast

import numpy as np

from proxcgal import _core
from proxcgal.core.transforms import rotation_from_vector
from proxcgal.core.typing import Array
from proxcgal.evaluation.trial_log import TrialLog
from proxcgal.scenario.setup import Setup
from proxcgal.scenario.walkthrough_scenario import GuidedScenario
from proxcgal.sim.source import SimulatedSource
from proxcgal.sim.tick import TickInput
from proxcgal.sim.world import World
from proxcgal.trial.walkthrough.intended_path import IntendedPath
from proxcgal.trial.walkthrough.operator_hand import InteractiveHand, OperatorHand


class GuidedSource(SimulatedSource):
    """The simulated arm and its sensors; the goal of each tick is where the hand pulls."""

    def __init__(self, setup: Setup, world: World | None, seed: int) -> None:
        """Args: as `SimulatedSource`; the scenario is a guided one."""
        super().__init__(setup, world, seed)
        scenario = cast("GuidedScenario", setup.scenario)
        self._robot = setup.robot
        self._gain = scenario.controller.reach_gain
        self._admittance = _core.Admittance(
            _core.AdmittanceConfig(**scenario.admittance.model_dump())
        )
        self._pace = 1.0 / scenario.simulation.control_hz
        path = IntendedPath.of(scenario.legs, self._pace)
        start = np.array(setup.robot.tool_pose(setup.q0))
        self._hand = OperatorHand(scenario.hand, path, start, self._pace, seed)
        self._cycle = 0
        self._twist = np.zeros(6)
        self._J = np.zeros((6, setup.robot.n_q))
        self._keys = scenario.hand
        #: A hand that a user moves, in place of the simulated operator's.
        self.user_hand: InteractiveHand | None = None

    def read(self) -> TickInput | None:
        """The next tick's inputs: the goal is one step of the hand ahead of the tool."""
        inputs = super().read()
        if inputs is None:
            return None
        T = np.array(self._robot.tool_pose(inputs.q))
        self._J = np.array(self._robot.tool_jacobian(inputs.q))
        tool = T[:3, 3], T[:3, :3], self._twist
        if self.user_hand is None:
            force, engaged = self._hand.force(self._cycle, *tool), True
        else:
            force, engaged = self.user_hand.force(*tool), self.user_hand.pose is not None
        wanted = np.array(self._admittance.step(force, engaged, self._pace))
        self._cycle += 1
        goal = T.copy()
        goal[:3, 3] += wanted[:3] / self._gain
        goal[:3, :3] = rotation_from_vector(wanted[3:] / self._gain) @ T[:3, :3]
        return replace(inputs, goal=goal)

    def take_over(self) -> InteractiveHand:
        """The hand that a user moves from now on; it holds nothing yet."""
        if self.user_hand is None:
            self.user_hand = InteractiveHand(self._keys, self._pace)
        return self.user_hand

    def command(self, qd: Array) -> None:
        """Velocity until the next tick (n_q,); the hand feels what became of its pull."""
        super().command(qd)
        self._twist = self._J @ qd
        self._admittance.held_to(self._twist)


def off_path(scenario: GuidedScenario, log: TrialLog) -> Array:
    """(n,) how far the tool is from the nearest point of the path that the hand intends [m]."""
    path_W = log.tool_W[0] + IntendedPath.of(scenario.legs, 0.005).position
    return np.array([np.linalg.norm(path_W - tool, axis=1).min() for tool in log.tool_W])


def off_paths(scenario: GuidedScenario, logs: Sequence[TrialLog]) -> dict[str, dict[str, float]]:
    """The most and the root mean square of it, by controller [m]."""
    found = {log.controller: off_path(scenario, log) for log in logs}
    return {
        name: {"max": float(apart.max()), "rms": float(np.sqrt((apart**2).mean()))}
        for name, apart in found.items()
    }

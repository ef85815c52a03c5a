"""A trial without end, driven by a page: solids moved by hand, sensors silenced.

The same way through as every trial: source -> injected faults -> tick.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from proxcgal.core.modes import STOP
from proxcgal.core.typing import Array
from proxcgal.evaluation.ground_truth import GroundTruth
from proxcgal.models.robots import Robot
from proxcgal.scenario.scenario import Scenario
from proxcgal.scenario.setup import Setup
from proxcgal.scene.dragging import DraggedSolids, LiveScene
from proxcgal.sim.clouds import Clouds
from proxcgal.sim.moment import Moment
from proxcgal.sim.tick import TickInput, TickResult
from proxcgal.trial.trial import assemble
from proxcgal.trial.walkthrough.guided_source import GuidedSource
from proxcgal.trial.walkthrough.operator_hand import HAND

_ENDLESS = 1e7  # [s]


class LiveTrial:
    """A scenario without end that takes a user's changes between two ticks."""

    def __init__(
        self,
        scenario: Scenario,
        controller: str,
        *,
        robot: Robot | None = None,
        q: Array | None = None,
        hands: DraggedSolids | None = None,
        since: float = 0.0,
    ) -> None:
        """Sets everything up.

        Args:
            scenario: what to run.
            controller: one of CONTROLLERS.
            robot: the scenario's, where it is loaded already.
            q: (n_q,) where the arm starts, instead of the scenario's q0.
            hands: those that hold solids already.
            since: of the scene, at the first tick [s].

        Raises:
            ConfigError: what of the scenario does not fit; sensors that do not sit where it says.
        """
        setup = Setup.of(scenario, robot)
        self.hands = hands or DraggedSolids()
        self.off: frozenset[int] = frozenset()  #: rows of the sensors that are silent
        self.since = since
        self.controller = controller
        scene, measured, drawn = (
            LiveScene(each, self.hands, since)
            for each in (setup.scene, setup.measured, setup.drawn)
        )
        self.setup = setup = replace(
            setup,
            scenario=scenario.model_copy(update={"duration": _ENDLESS}),
            scene=scene,
            measured=measured,
            drawn=drawn,
            q0=setup.q0 if q is None else np.array(q),
        )
        self._run = run = assemble(setup, controller)
        self.ctrl, self._source = run.ctrl, run.source
        if q is None:
            run.require_mounts()
        elif isinstance(run.source, GuidedSource):
            run.source.take_over()  # its path began elsewhere
        self._truth = GroundTruth(setup.robot, measured)
        self._count = 0
        self._ticks = run.ticks(self._spoiled)
        self._last: tuple[TickInput, TickResult] | None = None

    @property
    def period(self) -> float:
        """[s] from tick to tick."""
        return float(self.ctrl.config.period)

    @property
    def elapsed(self) -> float:
        """[s] of the scene's time at the last tick."""
        return self.since + max(self._count - 1, 0) * self.period

    @property
    def q(self) -> Array:
        """(n_q,) where the arm is."""
        return self._source.q

    @property
    def stopped(self) -> bool:
        """Is the controller in STOP? No request of a user leads out of it."""
        return self._last is not None and self._last[1].mode == STOP

    @property
    def cpu_us(self) -> float:
        """Of the last tick's thread."""
        return 0.0 if self._last is None else self._last[1].cpu_us

    def step(self) -> TickResult:
        """One tick."""
        self.hands.advance(self.period)
        self._last = next(self._ticks)
        self._count += 1
        return self._last[1]

    def __iter__(self) -> Iterator[TickResult]:
        """Tick after tick, without end."""
        while True:
            yield self.step()

    def move(self, name: str, wanted: Array) -> None:
        """Has a hand take a solid to a pose (4, 4) T_WO; unknown names are passed over.

        `HAND`, of a guided arm, is the hand at the tool: from then on a user moves it.
        """
        if name == HAND and isinstance(self._source, GuidedSource):
            self._source.take_over().move(self._tool(), wanted)
        elif name in self.setup.scene.names:
            row = self.setup.scene.names.index(name)
            now = self.setup.scene.poses(max(self._count - 1, 0) * self.period)[row]
            self.hands.move(name, now, wanted)

    def release(self) -> None:
        """Lets go of all that is held."""
        self.hands.release()
        if isinstance(self._source, GuidedSource) and self._source.user_hand is not None:
            self._source.user_hand.let_go()

    def moment(self) -> Moment:
        """What there is to see now, the true distance with it."""
        assert self._last is not None, "step() comes first"
        inputs, result = self._last
        now = (self._count - 1) * self.period
        true = self._truth.nearest(self._source.q, now).distance
        q = inputs.q if np.isfinite(inputs.q).all() else self._source.q
        held = np.isin(self.ctrl.cloud_origins()[:, 0], list(self.off))
        return Moment.of(
            self.setup, inputs, result, Clouds.of(self.ctrl), now, q=q, true=true,
            since=self.since, held=held, **self._hand(),
        )  # fmt: skip

    def _hand(self) -> dict[str, Any]:
        """The hand at the tool of a guided arm: where it is, and whether a user holds it."""
        if not isinstance(self._source, GuidedSource):
            return {}
        hand = self._source.user_hand
        pose = None if hand is None else hand.pose
        return {"hand_W": self._tool() if pose is None else pose, "gripped": pose is not None}

    def _tool(self) -> Array:
        return np.array(self.setup.robot.tool_pose(self._source.q))

    def _spoiled(self, inputs: TickInput) -> TickInput:
        """What the controller gets: the scenario's faults, and nothing of silent sensors."""
        inputs = self._run.faults(inputs)
        if not self.off:
            return inputs
        return replace(inputs, scans=tuple(s for s in inputs.scans if s.sensor not in self.off))

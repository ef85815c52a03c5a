"""Goals of whatever arm, one at a time: numbered, cancelled, and each ended exactly once."""

from collections import OrderedDict
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from proxcgal.core.typing import Array
from proxcgal.evaluation.termination import Outcome
from proxcgal.server.goals import (
    AT_REST,
    KEPT_RESULTS,
    STOPPED_AFTER,
    GoalResult,
    State,
)
from proxcgal.sim.tick import TickResult

CANCELLED = "cancelled by the client"
_AT_BOUND = 0.9  # share of an acceleration limit from which a joint is at it


@dataclass(slots=True)
class Pursued:
    """A goal that has not ended."""

    number: int
    begun: float  # [s]
    state: State = "executing"


P = TypeVar("P", bound=Pursued)


class GoalLedger(Generic[P]):
    """Which goal is pursued, and how the others ended; the oldest ends are forgotten."""

    def __init__(self) -> None:
        """Nothing is pursued."""
        self.active: P | None = None  #: the one that is pursued
        self._count = 0
        self._cancelled, self._qdd_max = 0.0, np.empty(0)  # when [s], and what the arm brakes with
        self._qd: Array | None = None  # of the tick before, while the arm brakes
        self._results: OrderedDict[int, GoalResult] = OrderedDict()

    @property
    def next(self) -> int:
        """The number that the next goal will have."""
        return self._count + 1

    def take(self, goal: P) -> int:
        """Pursues a goal; the one before it has ended. Returns: its number."""
        assert self.active is None
        assert goal.number == self.next
        self._count, self.active = goal.number, goal
        return goal.number

    def result(self, number: int) -> GoalResult | None:
        """How it ended; None while it has not, and where it never was or is forgotten."""
        return self._results.get(number)

    def cancel(self, number: int, time: float, qdd_max: Array) -> bool:
        """The arm brakes from here on; False: it does already, or the goal has ended."""
        active = self.active
        if active is None or active.number != number or active.state == "cancelling":
            return False
        active.state, self._qd = "cancelling", None
        self._cancelled, self._qdd_max = time, qdd_max
        return True

    def braked(self, time: float, passed: float, result: TickResult | None) -> str | None:
        """Why the cancelled goal ends with this tick; None: the arm brakes still.

        It ends at rest, or at what the tasks above reaching still ask for. A command changes as
        fast as the acceleration limits allow until it is what those ask for: where no joint is at
        its limit any more, what still moves the arm is theirs.

        Args:
            time: of the tick [s].
            passed: since the tick before [s].
            result: of the tick; None where there was none.
        """
        if (
            result is None
            or np.abs(result.qd).max() <= AT_REST
            or time - self._cancelled > STOPPED_AFTER
        ):
            return CANCELLED
        before, self._qd = self._qd, result.qd
        if before is None:
            return None
        share = np.abs(result.qd - before) / (self._qdd_max * max(passed, 1e-9))
        moving = _above_reaching(result)
        if not moving or share.max() >= _AT_BOUND:
            return None
        return f"{CANCELLED}; {', '.join(moving)} still moves the arm"

    def end(self, outcome: Outcome, reason: str, time: float, errors: tuple[float, float]) -> None:
        """The one place where a goal ends.

        Args:
            outcome: of it.
            reason: as text.
            time: [s].
            errors: [m] and [rad] that remain.
        """
        goal = self.active
        assert goal is not None
        assert goal.number not in self._results
        self._results[goal.number] = GoalResult(
            goal.number, outcome, reason, time - goal.begun, *errors
        )
        while len(self._results) > KEPT_RESULTS:
            self._results.popitem(last=False)
        self.active = None


def _above_reaching(result: TickResult) -> list[str]:
    """Tasks that are active and go before the goal, the most important first."""
    names = [task.name for task in result.tasks]
    above = result.tasks[: names.index("reach")] if "reach" in names else result.tasks
    return [task.name for task in above if max(task.activation, default=0.0) > 0.0]

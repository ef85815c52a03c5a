"""When a run is over: the goal reached, or no progress towards it for too long."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from proxcgal.core.transforms import pose_errors
from proxcgal.core.typing import Array
from proxcgal.scenario.goal_keys import FinishKeys

Outcome = Literal["succeeded", "aborted", "cancelled"]


@dataclass(frozen=True, slots=True)
class StallCause:
    """What keeps the arm from its goal."""

    task: str = ""  #: "" where no single task does
    link: str = ""  #: that the task moves; a joint for joint limits
    obstacle: str = ""  #: the nearest one's name, or the other link
    sensor: int = -1  #: that saw it, where one did
    zone: int = -1
    freed: float = 0.0  #: [m/s] or [rad/s] towards the goal that leaving the task out would give

    def __str__(self) -> str:
        """In words."""
        words = {
            "avoidance": "held off by the obstacle",
            "self_collision": "held off by the robot itself",
            "joint_limits": "held by a joint limit",
            "minimum_altitude": "held up by the minimum altitude",
        }
        if not self.task:
            return "no single task holds it"
        text = words.get(self.task, f"held by {self.task}")
        parts = [part for part in (self.link, self.obstacle) if part]
        if self.sensor >= 0:
            parts.append(f"sensor {self.sensor}, zone {self.zone}")
        return text + (f" ({', '.join(parts)})" if parts else "")


@dataclass(frozen=True, slots=True)
class Ending:
    """How a run ended."""

    outcome: Outcome
    reason: str
    holding: StallCause | None = None


@dataclass(slots=True, eq=False)
class GoalWatch:
    """Is the goal reached, or has nothing come nearer to it for a while?"""

    finish: FinishKeys
    goal: Array  #: (4, 4) T_WT
    #: [m], [rad] that counted as progress last, and since when [s].
    _least: list[float] = field(default_factory=lambda: [np.inf, np.inf], init=False)
    _since: float = field(default=0.0, init=False)

    def __call__(self, time: float, T_WT: Array) -> Ending | None:
        """How the run ends here, or None: it goes on.

        Progress is a least error so far, in position or in angle, that fell by a set amount.
        """
        errors, finish = pose_errors(T_WT, self.goal), self.finish
        if errors[0] <= finish.position and errors[1] <= finish.angle:
            return Ending("succeeded", "the goal is reached")
        for row, error in enumerate(errors):
            if error <= self._least[row] - finish.progress:
                self._least[row], self._since = error, time
        if time - self._since > finish.patience:
            return Ending("aborted", f"no progress for {finish.patience:g} s")
        return None

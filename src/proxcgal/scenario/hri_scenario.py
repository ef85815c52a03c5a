"""Scenarios with a person beside the arm, whose keys stand under `[operator]`."""

from proxcgal.scenario.scenario import Scenario
from proxcgal.scene.human.operator_keys import Operator
from proxcgal.scene.human.person import Person, person_of
from proxcgal.scene.obstacles import Scene, Together


class HriScenario(Scenario):
    """A person walks in and works beside the arm; distances run to that person alone."""

    operator: Operator

    def person(self) -> Person:
        """Who works there.

        Raises:
            ConfigError: a recording that cannot be read; a place out of reach, or not in time.
        """
        return person_of(self.operator, self.duration)

    def scene(self) -> Scene:
        """The person, and what else can be sensed."""
        return Together(self.person(), super().scene())

    def measured(self) -> Scene:
        """The person."""
        return self.person()

    def drawn(self) -> Scene:
        """The person, and all that stands round."""
        return Together(self.person(), super().drawn())

    @property
    def floor(self) -> float:
        """Height of the floor that the person stands on [m]; sensors see none."""
        return self.operator.floor

    def signals(self) -> list[tuple[float, str]]:
        """Time [s] and note of every signal of the timeline; none that a recording heeds."""
        if self.operator.recording is not None:
            return []
        return [(step.at, step.note) for step in self.operator.timeline]

    @property
    def on_the_left(self) -> bool:
        """Does the person work on the arm's left?"""
        step = self.operator.timeline[0]
        return self.operator.marks[step.mark][1] > 0.0

    def windows(self) -> dict[str, tuple[float, float]]:
        """Start and end of every phase that is reported, by name [s]."""
        steps = self.operator.timeline
        ends = [*(step.at for step in steps[1:]), self.duration]
        return {
            step.phase: (step.at, end)
            for step, end in zip(steps, ends, strict=True)
            if step.phase is not None
        }

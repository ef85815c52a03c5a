"""The keys of a scenario's `[operator]`: who walks in, where to, and when."""

from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, model_validator

from proxcgal.core.schema import Count, NonNegative, Positive, Section, Vector

Mark = Annotated[tuple[float, ...], Field(min_length=2, max_length=2)]


class Step(Section):
    """What the operator is told at one signal; the rest is as it was before."""

    at: NonNegative = Field(description="[s] of the signal")
    mark: str = Field(description="name of the mark to work from, or to walk to")
    reach: str | None = Field(
        None, description="name of the place that a hand goes to; left out: walks to the mark"
    )
    within: Positive = Field(
        6.0, description="[s] after the signal, by when hand or feet must be there"
    )
    phase: str | None = Field(
        None, description="name under which the time until the next signal is reported"
    )
    note: str = Field("", description="beside the signal in figures")


class Operator(Section):
    """A person in the workspace: drawn from a seed, or played from a recording."""

    subject: Count = Field(1, lt=2**63, description="which virtual subject, any number from 1")
    draw: int = Field(0, ge=0, description="seed that the virtual subjects are drawn from")
    recording: str | None = Field(
        None, description="CSV file of a recorded motion, played instead of the timeline's"
    )
    floor: float = Field(0.0, description="[m] height of the floor the feet stand on")
    start: str = Field(description="name of the mark to walk in from")
    marks: dict[str, Mark] = Field(description="[m] x and y on the floor, by name")
    places: dict[str, Vector] = Field(description="[m] that hands go to, by name")
    timeline: tuple[Step, ...] = Field(min_length=1, description="one for each signal")

    @property
    def who(self) -> str:
        """For titles: the subject's number, or the recording's file."""
        return f"subject {self.subject}" if self.recording is None else Path(self.recording).name

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        wanted = [("start", self.start, self.marks)]
        for row, step in enumerate(self.timeline):
            wanted.append((f"timeline.{row}.mark", step.mark, self.marks))
            if step.reach is not None:
                wanted.append((f"timeline.{row}.reach", step.reach, self.places))
        unknown = [
            f"{key} = {name!r} is not among {', '.join(known)}"
            for key, name, known in wanted
            if name not in known
        ]
        if unknown:
            raise ValueError("; ".join(unknown))
        signals = [step.at for step in self.timeline]
        if signals != sorted(set(signals)):
            raise ValueError(f"timeline: signals at {signals}: each must be later than the last")
        phases = [step.phase for step in self.timeline if step.phase is not None]
        if len(set(phases)) < len(phases):
            raise ValueError(f"timeline: phases {phases}: each name once")
        if "cycle" in phases:
            raise ValueError(
                f"timeline: phases {phases}: 'cycle' is the whole run, not one of them"
            )
        return self

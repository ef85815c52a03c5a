"""A recording's inputs, given to a controller again."""

import time as clock
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace

from proxcgal.core.errors import ConfigError
from proxcgal.evaluation.trial_log import TrialLog
from proxcgal.recording.reader import Recording
from proxcgal.scenario.loading import change_scenario
from proxcgal.scenario.setup import Setup
from proxcgal.scene.obstacles import Cloud, FixedCloud
from proxcgal.sim.loop import run_ticks
from proxcgal.sim.source import RecordedSource
from proxcgal.sim.tick import Tick


class Replay:
    """One controller on the inputs of one recording; the arm moves as recorded.

    With the recorded controller and settings, on the same build and instruction path, the answers
    are those of the recording, bit for bit.
    """

    def __init__(
        self, recording: Recording, controller: str | None = None, overrides: Sequence[str] = ()
    ) -> None:
        """Sets the controller up.

        Args:
            recording: of a run.
            controller: instead of the recorded one.
            overrides: `key.sub=value` on the recorded scenario.

        Raises:
            ConfigError: a bad override, scans are needed and none were recorded, or not every
                tick was.
        """
        settings = recording.settings
        if settings.ticks != "all":
            raise ConfigError(
                f"recording {recording.path}: holds the ticks that brought scans, to step through; "
                "commands can be computed again from every tick only"
            )
        scenario = change_scenario(settings.scenario, str(recording.path), overrides)
        self.recording = recording
        self.controller = controller or settings.controller
        self.setup = Setup.of(scenario)
        changed = sorted(
            name
            for name, digest in self.setup.mesh_hashes().items()
            if settings.meshes.get(name, digest) != digest
        )
        if changed and not overrides:
            warnings.warn(
                f"recording {recording.path}: was made with other meshes of {', '.join(changed)}: "
                "the replay will differ",
                RuntimeWarning,
                stacklevel=2,
            )
        self._known: Cloud | None = None
        if self.setup.uses_known_points(self.controller):
            recorded = settings.known_points_W
            self._known = self.setup.known_cloud() if recorded is None else FixedCloud(recorded)
        elif any(tick.inputs.known for tick in recording.ticks):
            raise ConfigError(
                f"recording {recording.path}: was made on known points and holds no scans, which "
                f"controller {self.controller!r} needs; wb_known does not"
            )
        self.ctrl = self.setup.make_controller(
            self.controller, 0 if self._known is None else len(self._known)
        )

    def __iter__(self) -> Iterator[Tick]:
        """Ticks with the new answers; `ctrl` then holds the state after the yielded one."""
        inputs = [
            replace(tick.inputs, known=self._known is not None) for tick in self.recording.ticks
        ]
        ticks = run_ticks(RecordedSource(inputs), self.ctrl, None, self._known)
        for then, (now, result) in zip(self.recording.ticks, ticks, strict=True):
            yield Tick(now, result, then.truth)


def recompute(
    recording: Recording, controller: str | None = None, overrides: Sequence[str] = ()
) -> TrialLog:
    """The log of a replay; distances that are true are those recorded. Raises: as `Replay`."""
    begin = clock.perf_counter()
    again = Replay(recording, controller, overrides)
    ticks = list(again)
    return TrialLog.of(
        ticks, again.setup.robot, scenario=again.setup.scenario.name,
        controller=again.controller, seed=recording.settings.seed,
        wall_s=clock.perf_counter() - begin, elapsed=recording.elapsed(),
    )  # fmt: skip


def first_difference(recording: Recording) -> int | None:
    """The first tick that its own settings do not give again bit for bit; None where all do."""
    again = Replay(recording)
    for row, (then, now) in enumerate(zip(recording.ticks, again, strict=True)):
        if not now.result.same(then.result):
            return row
    return None


def recorded_log(recording: Recording) -> TrialLog:
    """The log of the run itself, as it was recorded."""
    settings = recording.settings
    return TrialLog.of(
        recording.ticks, Setup.of(settings.scenario).robot, scenario=settings.scenario.name,
        controller=settings.controller, seed=settings.seed, wall_s=0.0,
        elapsed=recording.elapsed(),
    )  # fmt: skip

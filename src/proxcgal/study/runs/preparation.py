"""Before a run: its set-up is checked once, its folders are made and cleared of older files.

Nothing is written where something does not fit.
"""

import contextlib
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from proxcgal.core.errors import ConfigError
from proxcgal.core.progress import announce
from proxcgal.models.robots import Robot
from proxcgal.scenario.scenario import CONTROLLERS, Scenario
from proxcgal.scenario.setup import Setup
from proxcgal.scenario.walkthrough_scenario import WalkScenario
from proxcgal.study.campaign_store import MANIFEST, hold
from proxcgal.trial.trial import assemble
from proxcgal.trial.walkthrough.setup import WalkSetup

#: What a run writes. Older ones are removed before a run begins: an interrupted run must not leave
#: its recordings beside another run's numbers.
FILES = (
    "summary.json", "run.json", "scenario.toml", "report.html", "distance.png", "pairs.png",
    "motion.gif", "motion.png", *(f"{controller}.mcap" for controller in CONTROLLERS),
)  # fmt: skip


def check_setup(
    scenario: Scenario,
    controllers: Sequence[str],
    robot: Robot | None = None,
    *,
    quiet: bool = False,
) -> None:
    """Sets everything up once.

    A robot that is new to this machine has its meshes prepared here, and kept for the workers.

    Args:
        scenario: to be set up.
        controllers: so are these.
        robot: the scenario's, where it is loaded already.
        quiet: no message on stderr.

    Raises:
        ProxError: what of the scenario, the robot or the sensors cannot be; sensors that do not
            sit where the scenario says.
    """
    if isinstance(scenario, WalkScenario):
        WalkSetup.of(scenario, robot)
        return
    announce(f"setting up {scenario.name} (a robot's first time takes a while)", quiet=quiet)
    setup = Setup.of(scenario, robot)
    runs = [assemble(setup, controller) for controller in controllers]
    sensed = next((run for run in runs if run.world is not None), None)
    checks = None if sensed is None else sensed.require_mounts()
    if checks is not None:
        announce(
            f"{scenario.name}: {checks.judged} of {len(checks.sensors)} sensors see enough of the "
            "arm itself for their mounts to be judged; none is wrong",
            quiet=quiet,
        )


@contextlib.contextmanager
def ready_folders(folders: Sequence[Path]) -> Iterator[None]:
    """Makes the folders, shows that they can be written, removes an earlier run's files.

    They are this run's alone for the time of the context. At its end those that were not there
    before, and that nothing was written to, are removed.

    Raises:
        ConfigError: a folder cannot be made or written, holds a campaign, or another run is at work
            on it; none is left behind that was not there.
    """
    with contextlib.ExitStack() as held:
        made = _made_ready(folders, held)
        try:
            yield
        finally:
            _remove_empty(made)


def _made_ready(folders: Sequence[Path], held: contextlib.ExitStack) -> list[Path]:
    """The folders that were not there before, innermost last."""
    for folder in folders:
        if (folder / MANIFEST).exists():
            raise ConfigError(
                f"--out {folder}: holds a campaign; name another folder, or remove it"
            )
    made: list[Path] = []
    try:
        for folder in folders:
            missing = [p for p in (folder, *folder.parents) if not p.exists()]
            for path in reversed(missing):
                path.mkdir()
                made.append(path)
            hold(folder, held)
            with tempfile.TemporaryFile(dir=folder) as probe:
                probe.write(b"proxcgal")
    except ConfigError:
        _remove_empty(made)
        raise
    except OSError as error:
        _remove_empty(made)
        raise ConfigError(f"--out {folder}: cannot be written: {error.strerror or error}") from None
    for folder in folders:
        for name in FILES:
            (folder / name).unlink(missing_ok=True)
    return made


def _remove_empty(folders: Sequence[Path]) -> None:
    """Removes those of the folders, innermost last, that nothing was written to."""
    for path in reversed(folders):
        with contextlib.suppress(OSError):
            path.rmdir()

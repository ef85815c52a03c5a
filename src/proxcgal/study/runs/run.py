"""A run of one scenario, whatever its kind."""

from collections.abc import Sequence
from pathlib import Path

from proxcgal.scenario.joint_scenario import JointScenario
from proxcgal.scenario.scenario import Scenario
from proxcgal.scenario.walkthrough_scenario import WalkScenario
from proxcgal.study.runs.joint import run_joint
from proxcgal.study.runs.scenes import ScenePlan, run_scenes
from proxcgal.study.runs.walkthrough import run_walkthrough


def run_scenario(
    scenario: Scenario,
    controllers: Sequence[str],
    folder: Path,
    command: str,
    *,
    workers: int | None = None,
    pictures: bool = True,
    quiet: bool = False,
) -> bool:
    """Runs it, fills the folder, the report apart, and prints the results.

    Args:
        scenario: what to run.
        controllers: instead of the scenario's own, where any are named; a walk-through has none.
        folder: of the results.
        command: as typed; for `run.json`.
        workers: processes; None takes one a processor.
        pictures: draw the moving picture too.
        quiet: no progress on stderr.

    Returns:
        True where the run has failed: the robot came too near to itself.

    Raises:
        ProxError: what does not fit, a run that cannot go on.
        KeyboardInterrupt: with a message of what was kept.
    """
    if isinstance(scenario, WalkScenario):
        run_walkthrough(scenario, folder, command, quiet=quiet)
        return False
    names = tuple(dict.fromkeys(controllers or scenario.controllers()))
    if isinstance(scenario, JointScenario):
        return run_joint(scenario, names, folder, command, workers=workers, quiet=quiet)
    plan = ScenePlan(scenario=scenario, controllers=names, folder=folder)
    return run_scenes([plan], command, workers=workers, pictures=pictures, quiet=quiet)

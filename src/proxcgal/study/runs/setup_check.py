"""A scenario set up once before a run, so that nothing is written where something does not fit."""

from collections.abc import Sequence

from proxcgal.core.progress import announce
from proxcgal.models.robots import Robot
from proxcgal.scenario.scenario import Scenario
from proxcgal.scenario.setup import Setup
from proxcgal.scenario.walkthrough_scenario import WalkScenario
from proxcgal.trial.assembly import assemble
from proxcgal.trial.walkthrough.setup import WalkSetup


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

"""A scenario set up once before a run, so that nothing is written where something does not fit."""

from __future__ import annotations

from collections.abc import Sequence

from proxcgal.core.progress import announce
from proxcgal.models import Robot
from proxcgal.scenario.loading import Scenario
from proxcgal.scenario.setup import Setup
from proxcgal.scenario.walkthrough import WalkScenario
from proxcgal.sim.faults import FaultInjector
from proxcgal.sim.mount_faults import require_mounts
from proxcgal.sim.source import SimulatedSource
from proxcgal.sim.world import World
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
    for controller in controllers:
        setup.make_controller(controller)
    FaultInjector(scenario.faults, [mount.name for mount in setup.skin.mounts], scenario.seed)
    if scenario.skin.check_mounts and not all(map(setup.uses_known_points, controllers)):
        source = SimulatedSource(setup, World(setup.robot, setup.scene), scenario.seed)
        checks = require_mounts(setup, source)
        announce(
            f"{scenario.name}: {checks.judged} of {len(checks.sensors)} sensors see enough of the "
            "arm itself for their mounts to be judged; none is wrong",
            quiet=quiet,
        )

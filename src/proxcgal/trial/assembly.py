"""The parts of a trial: those of any simulated run, with a hand at the tool where one guides."""

from proxcgal.scenario.setup import Setup
from proxcgal.scenario.walkthrough_scenario import GuidedScenario
from proxcgal.sim.assembly import Assembly
from proxcgal.sim.source import SimulatedSource
from proxcgal.trial.walkthrough.guided_source import GuidedSource


def assemble(setup: Setup, controller: str, seed: int | None = None) -> Assembly:
    """Makes the controller, its faults, world and source.

    Args:
        setup: of the scenario.
        controller: one of CONTROLLERS.
        seed: instead of the scenario's.

    Raises:
        ConfigError: an unknown controller or sensor, a setting out of bounds.
        SimulationError: MuJoCo refuses the scene.
    """
    guided = isinstance(setup.scenario, GuidedScenario)
    return Assembly.of(setup, controller, seed, GuidedSource if guided else SimulatedSource)

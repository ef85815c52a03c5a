"""The parts of one run, assembled: controller, injected faults, world, source, known points."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Self

from proxcgal import _core
from proxcgal.core.errors import ConfigError
from proxcgal.models.mount_check import MountChecks, check_mounts
from proxcgal.scenario.setup import Setup
from proxcgal.scene.obstacles import Cloud
from proxcgal.sim.faults import FaultInjector
from proxcgal.sim.loop import run_ticks
from proxcgal.sim.source import SimulatedSource
from proxcgal.sim.tick import TickInput, TickResult
from proxcgal.sim.world import World

MOUNT_CHECK_SCANS = 30  #: of each sensor before a run: 2 s at 15 Hz

MakeSource = Callable[[Setup, World | None, int], SimulatedSource]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Assembly:
    """One simulated run: source -> injected faults -> tick."""

    setup: Setup
    controller: str  #: one of CONTROLLERS
    seed: int
    known: Cloud | None  #: points of the scene itself, where the controller gets those
    ctrl: _core.Controller
    faults: FaultInjector
    world: World | None  #: that the sensors measure; None: nothing is sensed
    source: SimulatedSource

    @classmethod
    def of(
        cls,
        setup: Setup,
        controller: str,
        seed: int | None = None,
        make_source: MakeSource = SimulatedSource,
    ) -> Self:
        """Makes every part.

        Args:
            setup: of the scenario.
            controller: one of CONTROLLERS.
            seed: instead of the scenario's.
            make_source: the arm and its sensors.

        Raises:
            ConfigError: an unknown controller or sensor, a setting out of bounds.
            SimulationError: MuJoCo refuses the scene.
        """
        scenario = setup.scenario
        seed = scenario.seed if seed is None else seed
        known = setup.known_cloud() if setup.uses_known_points(controller) else None
        ctrl = setup.make_controller(controller, 0 if known is None else len(known))
        faults = FaultInjector(scenario.faults, [mount.name for mount in setup.skin.mounts], seed)
        world = World(setup.robot, setup.scene) if known is None else None
        return cls(
            setup=setup, controller=controller, seed=seed, known=known, ctrl=ctrl, faults=faults,
            world=world, source=make_source(setup, world, seed),
        )  # fmt: skip

    def ticks(
        self, spoil: Callable[[TickInput], TickInput] | None = None
    ) -> Iterator[tuple[TickInput, TickResult]]:
        """Tick after tick; `spoil` replaces the scenario's faults."""
        return run_ticks(self.source, self.ctrl, spoil or self.faults, self.known)

    def mount_checks(self) -> MountChecks:
        """What the sensors' view of the arm at its start says of their mounts."""
        setup, source = self.setup, self.source
        if self.world is None:
            source = SimulatedSource(setup, World(setup.robot, setup.scene), self.seed)
        return check_mounts(setup.robot, setup.skin, setup.q0, source.standing(MOUNT_CHECK_SCANS))

    def require_mounts(self) -> MountChecks | None:
        """The same, where the scenario asks for it and there are sensors; None otherwise.

        Raises:
            ConfigError: mounts that are wrong, one line each.
        """
        if self.world is None or not self.setup.scenario.skin.check_mounts:
            return None
        checks = self.mount_checks()
        if not checks:
            name = self.setup.scenario.name
            lines = [f"scenario {name}: skin: {check}" for check in checks.wrong]
            raise ConfigError(
                "\n".join(lines) + f"\nscenario {name}: sensors do not sit where the skin says, by "
                "what they see of the arm itself; mend their mounts, or leave the check out with "
                "skin.check_mounts=false"
            )
        return checks

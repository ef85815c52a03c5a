"""What all sensors see of a scene, from a robot that stands still."""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from proxcgal import _core
from proxcgal.core.typing import Array, Bools
from proxcgal.scenario.scenario import Scenario
from proxcgal.scenario.setup import Setup
from proxcgal.sim.assembly import Assembly
from proxcgal.sim.range_sensor import ZONES
from proxcgal.sim.tick import TickInput


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticScan:
    """Scans of every sensor, and their points: scan by scan, sensor by sensor, zone by zone."""

    setup: Setup  #: robot with the meshes that the filter used, skin, posture `q0`, goal
    scans: tuple[_core.Scan, ...]
    origins_W: Array  #: (n, 3) [m] emitter of each point
    points_W: Array  #: (n, 3) [m] all that was sensed, the robot itself included
    tolerance: Array  #: (n,) [m] epsilon of the filter: grows with the range's noise
    environment: Bools  #: (n,) true where the filter keeps the point

    def within(self, reach: float) -> Self:
        """The same without the points whose ray is longer than that [m]."""
        near = np.linalg.norm(self.points_W - self.origins_W, axis=1) <= reach
        return replace(self, **{name: getattr(self, name)[near] for name in _BY_POINT})


_BY_POINT = ("origins_W", "points_W", "tolerance", "environment")


def scan_static(scenario: Scenario, scans: int = 1) -> StaticScan:
    """Simulates the first scans of a scenario, and filters them as its controller does.

    Noise, dropout and self-hits are those of a run with the scenario's seed; the arm is not moved,
    faults are left out, and the sensors measure together even where they would take turns.

    Args:
        scenario: robot, posture, sensors, scene.
        scans: of each sensor; their points come one scan after the other.

    Raises:
        ConfigError: what of the scenario does not fit the robot.
        SimulationError: the simulator warned.
    """
    simulation = scenario.simulation.model_copy(update={"stagger": False})
    long_enough = max(scenario.duration, (scans + 1) / simulation.sensor_hz)
    changed: dict[str, Any] = {
        "simulation": simulation, "duration": long_enough, "faults": (),
    }  # fmt: skip
    run = Assembly.of(Setup.of(scenario.model_copy(update=changed)), "wb")
    ctrl = run.ctrl
    taken: list[StaticScan] = []
    while len(taken) < scans and (inputs := run.source.read()) is not None:
        ctrl.tick(inputs.time, inputs.q, list(inputs.scans), inputs.goal)
        if inputs.scans:
            kept = np.zeros((len(run.setup.skin), ZONES), bool)
            kept[tuple(np.asarray(ctrl.cloud_origins()).T)] = True
            taken.append(_placed(run.setup, inputs, kept))
    return StaticScan(
        setup=run.setup,
        scans=tuple(scan for part in taken for scan in part.scans),
        **{name: np.concatenate([getattr(part, name) for part in taken]) for name in _BY_POINT},
    )


def _placed(setup: Setup, inputs: TickInput, kept: Bools) -> StaticScan:
    """One scan of every sensor: what the core's sense stage makes of it, emitters beside."""
    settings, model = setup.scenario.controller.filter, setup.skin.model
    poses_W = np.asarray(setup.robot.link_poses(inputs.q))
    links = setup.robot.link_names
    parts = []
    for scan in inputs.scans:
        mount = setup.skin.mounts[scan.sensor]
        T_WS = poses_W[links.index(mount.link)] @ np.asarray(mount.T_LS)
        zones, points_S, _, sigma = (np.asarray(part) for part in _core.sense(model, scan))
        points_W = points_S @ T_WS[:3, :3].T + T_WS[:3, 3]
        above = points_W[:, 2] >= settings.z_min
        parts.append((
            np.tile(T_WS[:3, 3], (int(above.sum()), 1)),
            points_W[above],
            np.maximum(settings.tolerance, settings.sigmas * sigma[above]),
            kept[scan.sensor, zones[above]],
        ))  # fmt: skip
    columns: dict[str, Any] = {
        name: np.concatenate(column)
        for name, column in zip(_BY_POINT, zip(*parts, strict=True), strict=True)
    }
    return StaticScan(setup=setup, scans=inputs.scans, **columns)

"""What the cells of the timing grid work on: robot, posture and cloud, as [WA] III-C has them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from proxcgal.core.errors import ConfigError
from proxcgal.core.typing import Array
from proxcgal.models.robots import Robot, load_robot
from proxcgal.scenario.scenario import Scenario
from proxcgal.sim.static_scan import StaticScan, scan_static

SCENARIOS = ("timing_ur10e", "timing_panda")
VERTICES = (100, 300, 1000, 3000, 10000)  # a link
REACH = {"raw": np.inf, "2m": 2.0, "1m": 1.0}  # [m] along the ray, of the cloud of that name


@dataclass(frozen=True, slots=True, kw_only=True)
class Inputs:
    """Arguments of both algorithms in one cell of the grid.

    Algorithm 1 gets the cloud as it was sensed, the robot's own body in it. Algorithm 2 gets what
    the controller's filter leaves of that, as in the paper's pipeline: on the robot's own points
    every distance would be nothing. The clouds do not depend on the meshes of the cell, so that
    along the axis of vertices nothing else changes.
    """

    robot: Robot
    vertices: int  # asked for, of each link
    cloud: str  # one of REACH
    q: Array  # (n_q,)
    origins_W: Array  # (n, 3) [m] Algorithm 1: emitters
    points_W: Array  # (n, 3) [m] Algorithm 1: measured points
    tolerance: Array  # (n,) [m] Algorithm 1: epsilon
    environment_W: Array  # (m, 3) [m] Algorithm 2
    seen: StaticScan  # what they come from: scans, sensors, goal


def grid_inputs(
    scenario: Scenario,
    vertices: Sequence[int],
    clouds: Sequence[str] = tuple(REACH),
    scans: int = 1,
) -> Iterator[Inputs]:
    """The inputs of one robot's cells: resolution by resolution, cloud by cloud.

    Args:
        scenario: a robot that stands still, with its sensors and a scene.
        vertices: of the meshes of each link; they are met whatever the deviation.
        clouds: names in REACH.
        scans: of each sensor; the grid takes one, more make larger clouds.

    Raises:
        ConfigError: what of the scenario does not fit, or a cloud without a point.
        ModelError: the robot's description.
        SimulationError: the simulator warned.
    """
    snapshot = scan_static(scenario, scans)
    cropped = {cloud: snapshot.within(REACH[cloud]) for cloud in clouds}
    empty = [
        f"scenario {scenario.name}: the cloud {cloud!r} (rays up to {REACH[cloud]:g} m) has no "
        "point that the filter keeps: something must stand there"
        for cloud, near in cropped.items()
        if not near.environment.any()
    ]
    if empty:
        raise ConfigError("\n".join(empty))
    for count in vertices:
        robot = load_robot(
            scenario.robot,
            package_dirs=scenario.package_dirs,
            vertices_per_link=count,
            speed_limits=scenario.limits.speed,
            acceleration_limits=scenario.limits.acceleration,
            max_deviation=np.inf,
        )
        for cloud, near in cropped.items():
            yield Inputs(
                robot=robot, vertices=count, cloud=cloud, q=snapshot.setup.q0,
                origins_W=near.origins_W, points_W=near.points_W, tolerance=near.tolerance,
                environment_W=near.points_W[near.environment], seen=near,
            )  # fmt: skip

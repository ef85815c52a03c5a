"""The parts of a page's scene that do not change; plain data, for another process too."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from proxcgal.core.typing import Array
from proxcgal.models.mesh.display import display_meshes
from proxcgal.models.robots import Robot
from proxcgal.scenario.setup import Setup
from proxcgal.scene.solids import CapsuleSolid, Solid
from proxcgal.trial.walkthrough.interactive import WalkTrial
from proxcgal.trial.walkthrough.interactive_hand import HAND

OPERATOR = "operator"  #: the capsule that rides on the tool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SceneModel:
    """One robot with its sensors, and the scene's solids."""

    robot: str
    scenario: str
    links: tuple[str, ...]
    meshes: tuple[tuple[NDArray[np.float32], NDArray[np.uint32]], ...]  #: vertices_L, triangles
    sensors: tuple[str, ...]
    sensor_links: tuple[int, ...]  #: row of each sensor's link
    sensors_L: Array  #: (sensors, 4, 4) T_LS
    field_of_view: float  #: [rad] of a sensor, from side to side
    names: tuple[str, ...]  #: of the solids
    sensed: tuple[str, ...]  #: of them; no other is seen by any sensor
    draggable: tuple[str, ...]  #: what can be dragged: solids that are sensed, a hand at the tool
    solids: tuple[Solid, ...]
    solids_W: Array  #: (solids, 4, 4) T_WO at the start
    tool_W: Array  #: (3,) at the start [m]
    d_min: float = 0.0  #: [m]
    buffer: float = 0.0  #: [m]
    gain: float = 0.0  #: [1/s]

    @classmethod
    def of(cls, setup: Setup) -> Self:
        """Of what a trial is set up with; its solids where they are at the start."""
        links = list(setup.robot.link_names)
        mounts = setup.skin.mounts
        settings = setup.scenario.controller
        return cls(
            robot=setup.robot.name,
            scenario=setup.scenario.name,
            links=tuple(links),
            meshes=_meshes(setup.robot),
            sensors=tuple(mount.name for mount in mounts),
            sensor_links=tuple(links.index(mount.link) for mount in mounts),
            sensors_L=np.array([mount.T_LS for mount in mounts]).reshape(-1, 4, 4),
            field_of_view=setup.scenario.skin.sensor.field_of_view,
            names=setup.drawn.names,
            sensed=setup.scene.names,
            draggable=((HAND,) if setup.scenario.kind == "guided" else ()) + setup.scene.names,
            solids=setup.drawn.solids,
            solids_W=np.asarray(setup.drawn.poses(0.0)),
            tool_W=np.asarray(setup.robot.tool_pose(setup.q0))[:3, 3],
            d_min=settings.d_min,
            buffer=settings.buffer,
            gain=settings.avoid_gain,
        )

    @classmethod
    def of_walk(cls, trial: WalkTrial) -> Self:
        """Of a walk-through cell: the arm's capsules, and the operator's."""
        setup = trial.setup
        human = setup.scenario.guard.human
        return cls(
            robot=setup.robot.name,
            scenario=setup.scenario.name,
            links=tuple(setup.robot.link_names),
            meshes=_meshes(setup.robot),
            sensors=(),
            sensor_links=(),
            sensors_L=np.empty((0, 4, 4)),
            field_of_view=0.0,
            names=(OPERATOR,),
            sensed=(OPERATOR,),
            draggable=(HAND,),
            solids=(CapsuleSolid(human.radius, human.height - 2.0 * human.radius),),
            solids_W=trial.operator_W()[None],
            tool_W=np.asarray(setup.robot.tool_pose(setup.q0))[:3, 3],
        )

    @property
    def key(self) -> tuple[Any, ...]:
        """Equal for models that are drawn alike."""
        return (
            self.robot,
            self.links,
            self.sensors,
            self.names,
            self.draggable,
            self.solids,
            self.sensors_L.tobytes(),
        )


def _meshes(robot: Robot) -> tuple[tuple[NDArray[np.float32], NDArray[np.uint32]], ...]:
    return tuple(
        (np.asarray(v, np.float32), np.asarray(f, np.uint32)) for v, f in display_meshes(robot)
    )

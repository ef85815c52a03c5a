"""Whole-arm avoidance from a few multizone time-of-flight sensors.

Ranges become a cloud, the robot's own body is removed from it, the closest pair between cloud
and robot drives a highest-priority avoidance task; the goal is reached in what freedom is left.
"""

from importlib import import_module as _import_module
from importlib.metadata import version as _version
from typing import TYPE_CHECKING

from proxcgal._core import (
    Admittance,
    AdmittanceConfig,
    Avoidance,
    Capsule,
    CapsulePair,
    ClosestPair,
    Controller,
    ControllerConfig,
    FilterConfig,
    Finding,
    Guard,
    GuardConfig,
    HandGuide,
    IsoSeparation,
    JointLimits,
    JointSpec,
    LinkCapsule,
    LinkSpec,
    Manipulability,
    MemoryConfig,
    MeshTree,
    MinimumAltitude,
    Mode,
    MonitorConfig,
    MotionConfig,
    Mount,
    Reach,
    Scan,
    SelfCollision,
    SensorModel,
    SignedDistances,
    Skin,
    Solution,
    SolverConfig,
    Task,
    TaskReport,
    TickOutput,
    approach_speed,
    capsule_distances,
    closest_capsules,
    closest_pair,
    closest_pairs,
    closing_speed,
    guard_contradictions,
    mesh_distance,
    protective_distance,
    remove_body,
    self_distances,
    signed_distance,
    solve,
    zone_directions,
)
from proxcgal.core.errors import (
    ConfigError,
    GeometryError,
    ModelError,
    ModelWarning,
    ProxError,
    RecordingError,
    SimulationError,
)
from proxcgal.models import (
    MountCheck,
    MountChecks,
    Robot,
    attach,
    attach_mesh,
    check_mounts,
    fit_capsules,
    load_robot,
    ring_skin,
)

if TYPE_CHECKING:
    from proxcgal.server.goals import GoalRefusedError, JointGoal
    from proxcgal.server.joint_server import JointRobotServer

__version__ = _version("proxcgal")

__all__ = [
    "Admittance",
    "AdmittanceConfig",
    "Avoidance",
    "Capsule",
    "CapsulePair",
    "ClosestPair",
    "ConfigError",
    "Controller",
    "ControllerConfig",
    "FilterConfig",
    "Finding",
    "GeometryError",
    "GoalRefusedError",
    "Guard",
    "GuardConfig",
    "HandGuide",
    "IsoSeparation",
    "JointGoal",
    "JointLimits",
    "JointRobotServer",
    "JointSpec",
    "LinkCapsule",
    "LinkSpec",
    "Manipulability",
    "MemoryConfig",
    "MeshTree",
    "MinimumAltitude",
    "Mode",
    "ModelError",
    "ModelWarning",
    "MonitorConfig",
    "MotionConfig",
    "Mount",
    "MountCheck",
    "MountChecks",
    "ProxError",
    "Reach",
    "RecordingError",
    "Robot",
    "Scan",
    "SelfCollision",
    "SensorModel",
    "SignedDistances",
    "SimulationError",
    "Skin",
    "Solution",
    "SolverConfig",
    "Task",
    "TaskReport",
    "TickOutput",
    "approach_speed",
    "attach",
    "attach_mesh",
    "capsule_distances",
    "check_mounts",
    "closest_capsules",
    "closest_pair",
    "closest_pairs",
    "closing_speed",
    "fit_capsules",
    "guard_contradictions",
    "load_robot",
    "mesh_distance",
    "protective_distance",
    "remove_body",
    "ring_skin",
    "self_distances",
    "signed_distance",
    "solve",
    "zone_directions",
]

#: Made on first use: they need the simulator, which takes longer to import than all the rest.
_LATER = {
    "GoalRefusedError": "proxcgal.server.goals",
    "JointGoal": "proxcgal.server.goals",
    "JointRobotServer": "proxcgal.server.joint_server",
}


def __getattr__(name: str) -> object:
    if name in _LATER:
        return getattr(_import_module(_LATER[name]), name)
    raise AttributeError(f"module 'proxcgal' has no attribute '{name}'")

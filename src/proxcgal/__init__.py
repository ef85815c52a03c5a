"""Whole-arm avoidance from a few multizone time-of-flight sensors.

Ranges become a cloud, the robot's own body is removed from it, the closest pair between cloud
and robot drives a highest-priority avoidance task; the goal is reached in what freedom is left.
"""

from importlib import import_module as _import_module
from importlib.metadata import version as _version
from typing import TYPE_CHECKING

from proxcgal._core import (
    ActiveLimit,
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
    LimitConfig,
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

if TYPE_CHECKING:
    from proxcgal.models.assembly import attach, attach_mesh
    from proxcgal.models.builtin import list_robots
    from proxcgal.models.capsule_fit import fit_capsules
    from proxcgal.models.mount_check import MountCheck, MountChecks, check_mounts
    from proxcgal.models.robots import Robot, load_robot
    from proxcgal.models.skins import ring_skin
    from proxcgal.scenario.loading import load_scenario
    from proxcgal.server.goals import GoalRefusedError, JointGoal
    from proxcgal.server.joint_server import JointRobotServer
    from proxcgal.trial.trial import run_trial

__version__ = _version("proxcgal")

__all__ = [
    "ActiveLimit",
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
    "LimitConfig",
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
    "list_robots",
    "load_robot",
    "load_scenario",
    "mesh_distance",
    "protective_distance",
    "remove_body",
    "ring_skin",
    "run_trial",
    "self_distances",
    "signed_distance",
    "solve",
    "zone_directions",
]

#: Imported on first use, by module: pydantic, mesh readers and the simulator take longer to import
#: than all the rest.
_LATER = {
    "models.assembly": ("attach", "attach_mesh"),
    "models.builtin": ("list_robots",),
    "models.capsule_fit": ("fit_capsules",),
    "models.mount_check": ("MountCheck", "MountChecks", "check_mounts"),
    "models.robots": ("Robot", "load_robot"),
    "models.skins": ("ring_skin",),
    "scenario.loading": ("load_scenario",),
    "server.goals": ("GoalRefusedError", "JointGoal"),
    "server.joint_server": ("JointRobotServer",),
    "trial.trial": ("run_trial",),
}


def __getattr__(name: str) -> object:
    for module, names in _LATER.items():
        if name in names:
            return getattr(_import_module(f"proxcgal.{module}"), name)
    raise AttributeError(f"module 'proxcgal' has no attribute '{name}'")

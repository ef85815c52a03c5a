"""Robots and sensor layouts: from description files to what controller and simulator use."""

from proxcgal.models.assembly import attach, attach_mesh
from proxcgal.models.builtin import list_robots
from proxcgal.models.capsule_fit import fit_capsules
from proxcgal.models.description import RobotDescription
from proxcgal.models.formats.description_reader import read_description
from proxcgal.models.mount_check import MountCheck, MountChecks, check_mounts
from proxcgal.models.robots import Robot, load_robot
from proxcgal.models.skins import ring_skin

__all__ = [
    "MountCheck",
    "MountChecks",
    "Robot",
    "RobotDescription",
    "attach",
    "attach_mesh",
    "check_mounts",
    "fit_capsules",
    "list_robots",
    "load_robot",
    "read_description",
    "ring_skin",
]

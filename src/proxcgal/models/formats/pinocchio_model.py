"""From pinocchio's model of a URDF to joints and frames."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from proxcgal.core.errors import ModelError
from proxcgal.models.description import Frame, Joint


def joints_and_frames(
    model: Any, speeds: Mapping[str, float], source: Path
) -> tuple[list[Joint], list[Frame]]:
    """The joints of pinocchio's model and the frames of its links, in its own root frame.

    Args:
        model: pinocchio.Model of revolute and prismatic joints.
        speeds: speed limits, by joint; nan for those that are not there.
        source: the file, for messages.

    Raises:
        ModelError: a joint of more than one degree of freedom.
    """
    import pinocchio as pin  # here, because a warm cache does without it

    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    joints = [_joint(model, data, i, speeds, source) for i in range(1, model.njoints)]
    frames = [
        Frame(name=f.name, joint=f.parentJoint - 1, T_JF=f.placement.homogeneous)
        for f in model.frames
        if f.type == pin.FrameType.BODY
    ]
    return joints, frames


def _joint(
    model: Any,
    data: Any,
    row: int,
    speeds: Mapping[str, float],
    source: Path,
) -> Joint:
    """One joint of pinocchio's model."""
    import pinocchio as pin  # as above

    name, kind, parent = model.names[row], model.joints[row], model.parents[row]
    if kind.nv != 1:
        raise ModelError(
            f"{source}: joint '{name}' has {kind.nv} degrees of freedom; revolute and prismatic "
            "joints are read"
        )
    jacobian = pin.getJointJacobian(model, data, row, pin.LOCAL).reshape(6, model.nv)
    motion = jacobian[:, kind.idx_v]
    linear = np.linalg.norm(motion[:3]) > 0.5
    axis = motion[:3] if linear else motion[3:]
    low, high = model.lowerPositionLimit[kind.idx_q], model.upperPositionLimit[kind.idx_q]
    if kind.nq != 1:  # turns without end
        low, high = -np.inf, np.inf
    return Joint(
        name=name,
        type="prismatic" if linear else "revolute",
        parent=parent - 1,
        origin=model.jointPlacements[row].homogeneous,
        axis=axis / np.linalg.norm(axis),
        q_min=float(low),
        q_max=float(high),
        qd_max=speeds.get(name, np.nan),
        qdd_max=np.nan,
    )

"""The body as capsules between points: which there are, how thick, where they stand."""

from dataclasses import dataclass

import numpy as np

from proxcgal.core.transforms import least_rotations_of_z
from proxcgal.core.typing import Array
from proxcgal.scene.human.subject import radius

#: What a motion says where it is, in this order. `head` is its top, `hand` the fingertips.
POINTS = (
    "pelvis", "neck", "head",
    "left_shoulder", "left_elbow", "left_wrist", "left_hand",
    "right_shoulder", "right_elbow", "right_wrist", "right_hand",
    "left_hip", "left_knee", "left_ankle",
    "right_hip", "right_knee", "right_ankle",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Part:
    """A capsule's segment, and the points it reaches between."""

    name: str
    segment: str
    start: str
    end: str
    open_start: bool = False  # the joint is the centre of its round end, not the end itself
    open_end: bool = False


def _sides(segment: str, start: str, end: str, joint_end: bool) -> list[Part]:
    return [
        Part(f"{side}_{segment}", segment, f"{side}_{start}", f"{side}_{end}", True, joint_end)
        for side in ("left", "right")
    ]


#: Joints are the centres of round ends; where a segment ends free, its round end ends there.
PARTS = (
    Part("head", "head", "neck", "head"),
    Part("torso", "torso", "pelvis", "neck", True, False),
    *_sides("upper_arm", "shoulder", "elbow", True),
    *_sides("forearm", "elbow", "wrist", True),
    *_sides("hand", "wrist", "hand", False),
    *_sides("thigh", "hip", "knee", True),
    *_sides("shin", "knee", "ankle", True),
)
NAMES = tuple(part.name for part in PARTS)
_START = np.array([POINTS.index(part.start) for part in PARTS])
_END = np.array([POINTS.index(part.end) for part in PARTS])
_UP = np.array([1.0 if part.segment in ("head", "torso") else -1.0 for part in PARTS])


def radii(stature: float) -> Array:
    """(parts,) of the capsules [m]."""
    return np.array([radius(part.segment, stature) for part in PARTS])


def segments(points_W: Array, thickness: Array) -> tuple[Array, Array]:
    """Centres of the capsules' round ends.

    Args:
        points_W: (n, POINTS, 3) [m].
        thickness: (parts,) radii [m].

    Returns:
        (n, parts, 3) start and end [m].
    """
    start, end = points_W[:, _START], points_W[:, _END]
    along = end - start
    length = np.linalg.norm(along, axis=-1, keepdims=True)
    along = along / np.maximum(length, 1e-9)
    # A free end is drawn in by the radius; never past the segment's middle.
    inset = np.minimum(thickness[None, :, None], 0.499 * length)
    start = start + along * inset * np.array([not p.open_start for p in PARTS])[:, None]
    return start, end - along * inset * np.array([not p.open_end for p in PARTS])[:, None]


def poses(start: Array, end: Array) -> Array:
    """(..., parts, 4, 4) T_WO of capsules between their round ends' centres (..., parts, 3) [m].

    The z axis leads upwards in somebody who stands with hanging arms.
    """
    T_WO = np.zeros((*start.shape[:-1], 4, 4))
    T_WO[..., :3, :3] = least_rotations_of_z((end - start) * _UP[:, None])
    T_WO[..., :3, 3] = 0.5 * (start + end)
    T_WO[..., 3, 3] = 1.0
    return T_WO

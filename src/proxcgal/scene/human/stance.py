"""Where somebody stands, and how they lean, so that a hand reaches a place."""

from dataclasses import dataclass

import numpy as np

from proxcgal.core.typing import Array
from proxcgal.scene.human.smooth import two_bones
from proxcgal.scene.human.subject import (
    HIP,
    HIPS,
    SHIN,
    SHOULDER,
    SHOULDERS,
    THIGH,
    Subject,
    radius,
)

STRAIGHT = 0.985  # of the leg's length: knees are never quite straight
STEP = 0.30  # length of a step at most, of stature
_BACK = 0.12  # the hips go back by this share of stature at a lean of 90 deg
_LEAN = 1.05  # [rad] at most
_APART = 0.30  # [m] feet to place at least, level
_STEP_COST, _LEAN_COST = 0.35, 0.6  # [m], [rad] that are as much trouble as each other

HANGING = np.array([[0.0, 0.0, -1.0], [0.17, 0.0, -0.985]])  # upper arm, forearm; torso's frame
CARRYING = np.array([[-0.10, 0.0, -0.995], [0.94, 0.0, 0.34]])
HANGING /= np.linalg.norm(HANGING, axis=1, keepdims=True)
CARRYING /= np.linalg.norm(CARRYING, axis=1, keepdims=True)


@dataclass(frozen=True, slots=True)
class Stance:
    """Standing still."""

    feet: Array  #: (2,) [m] midway between them
    yaw: float  #: [rad] facing, from x
    lean: float = 0.0  #: [rad] forward, from the hips


def torso(
    subject: Subject, floor: float, feet: Array, yaw: Array, lean: Array, stride: Array
) -> tuple[Array, Array]:
    """Mid hip and frame of the torso.

    Args:
        subject: whose.
        floor: its height [m].
        feet: (n, 2) midway between them [m].
        yaw: (n,) [rad].
        lean: (n,) [rad].
        stride: (n,) 0 standing, 1 walking: the hips are lower then.

    Returns:
        Mid hip (n, 3) [m]; R_WT (n, 3, 3), x forward, z along the spine.
    """
    stature, ankle = subject.stature, radius("shin", subject.stature)
    back = _BACK * np.sin(lean)
    height = ankle + stature * np.sqrt(
        (STRAIGHT * (THIGH + SHIN)) ** 2 - (back + 0.55 * STEP * stride) ** 2
    )
    (cy, sy), (cl, sl) = (np.cos(yaw), np.sin(yaw)), (np.cos(lean), np.sin(lean))
    pelvis = np.stack(
        [
            feet[:, 0] - stature * back * cy,
            feet[:, 1] - stature * back * sy,
            floor + height,
        ],
        axis=1,
    )
    R_WT = np.stack(
        [
            np.stack([cy * cl, -sy, cy * sl], axis=1),
            np.stack([sy * cl, cy, sy * sl], axis=1),
            np.stack([-sl, np.zeros_like(cy), cl], axis=1),
        ],
        axis=1,
    )
    return pelvis, R_WT


def shoulder(subject: Subject, side: float) -> Array:
    """(3,) from mid hip, in the torso's frame [m]; side 1 left, -1 right."""
    return subject.stature * np.array([0.0, side * SHOULDERS, SHOULDER - HIP])


def hip(subject: Subject, side: float) -> Array:
    """(3,) from mid hip, level, in the pelvis' frame [m]."""
    return subject.stature * np.array([0.0, side * HIPS, 0.0])


def grip(subject: Subject) -> float:
    """Elbow to the middle of the hand, where it holds things [m]."""
    return subject.forearm + 0.5 * subject.hand


def reaching(subject: Subject, side: float, place_T: Array) -> Array:
    """(n, 2, 3) directions of upper arm and forearm with the grip at places, in the torso's frame.

    Args:
        subject: whose arm.
        side: 1 left, -1 right.
        place_T: (n, 3) from mid hip [m].
    """
    root = np.broadcast_to(shoulder(subject, side), place_T.shape)
    pole = np.broadcast_to([-0.3, 0.5 * side, -1.0], place_T.shape)
    elbow = two_bones(root, place_T, subject.upper_arm, grip(subject), pole)
    arm = np.stack([elbow - root, place_T - elbow], axis=1)
    return np.asarray(arm / np.linalg.norm(arm, axis=2, keepdims=True))


def stance_for(
    subject: Subject, side: float, floor: float, mark: Array, place: Array
) -> Stance | None:
    """The least trouble of stepping off the mark and leaning; None where nothing reaches.

    Args:
        subject: who.
        side: of the hand: 1 left, -1 right.
        floor: its height [m].
        mark: (2,) [m].
        place: (3,) for the middle of the hand [m].
    """
    start = mark + subject.aside
    way = place[:2] - start
    distance = float(np.linalg.norm(way))
    ahead = way / max(distance, 1e-9)
    steps = np.linspace(min(-0.3, distance - 0.8), max(distance - _APART, -0.3), 121)
    grids = np.meshgrid(steps, np.linspace(0.0, _LEAN, 43), indexing="ij")
    step, lean = (grid.ravel() for grid in grids)
    feet = start + step[:, None] * ahead
    yaw = float(np.arctan2(way[1], way[0]) - side * subject.turn)
    pelvis, R_WT = torso(subject, floor, feet, np.full(len(step), yaw), lean, np.zeros(len(step)))
    arm = subject.upper_arm + grip(subject)
    reach = np.linalg.norm(place - pelvis - R_WT @ shoulder(subject, side), axis=1)
    fits = (reach <= subject.stretch * arm) & (reach >= 0.5 * arm) & (distance - step >= _APART)
    if not fits.any():
        return None
    cost = np.where(fits, (step / _STEP_COST) ** 2 + (lean / _LEAN_COST) ** 2, np.inf)
    best = int(np.argmin(cost))
    return Stance(feet[best], yaw, float(lean[best]))

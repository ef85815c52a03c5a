"""A hand that is moved takes its arm along, which bounds how far it goes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from proxcgal.core.transforms import least_rotation, perpendicular
from proxcgal.core.typing import Array
from proxcgal.scene.solids import CapsuleSolid, Solid

_STRETCHED = 0.999  # of both lengths: an arm is never quite straight


@dataclass(frozen=True, slots=True)
class ArmFollower:
    """Rows of three capsules, their z axes towards the shoulder, and their lengths [m]."""

    hand_name: str
    upper: int
    fore: int
    hand: int
    lengths: tuple[float, float, float]  #: of upper arm, forearm and hand, between round ends

    def follow(self, poses: Array) -> None:
        """Brings upper arm and forearm after the hand; the shoulder stays where it is.

        A hand beyond the arm's reach stops there.

        Args:
            poses: (n, 4, 4) T_WO of all solids, changed in place.
        """
        upper, fore, hand = self.lengths
        shoulder = _end(poses[self.upper], 0.5 * upper)
        elbow = _end(poses[self.upper], -0.5 * upper)
        towards = _end(poses[self.hand], 0.5 * hand) - shoulder
        far = max(float(np.linalg.norm(towards)), 1e-9)
        along = towards / far
        far = float(np.clip(far, abs(upper - fore) + 1e-6, _STRETCHED * (upper + fore)))
        wrist = shoulder + far * along
        poses[self.hand, :3, 3] = wrist - 0.5 * hand * poses[self.hand, :3, 2]
        # The elbow: on the circle that both lengths allow, where it is nearest to where it was.
        share = (upper**2 - fore**2 + far**2) / (2.0 * far)
        aside = elbow - shoulder
        aside = aside - (aside @ along) * along
        if np.linalg.norm(aside) < 1e-6:
            aside = -perpendicular(along)
        aside /= np.linalg.norm(aside)
        elbow = shoulder + share * along + np.sqrt(max(upper**2 - share**2, 0.0)) * aside
        _span(poses[self.upper], elbow, shoulder)
        _span(poses[self.fore], wrist, elbow)


def arm_followers(names: Sequence[str], solids: Sequence[Solid]) -> list[ArmFollower]:
    """The arms that these capsules make: `SIDE_upper_arm`, `SIDE_forearm`, `SIDE_hand`."""
    found = []
    for name in names:
        side = name.removesuffix("_hand")
        parts = [f"{side}_upper_arm", f"{side}_forearm", name]
        if side == name or not all(part in names for part in parts):
            continue
        rows = [list(names).index(part) for part in parts]
        capsules = [solid for row in rows if isinstance(solid := solids[row], CapsuleSolid)]
        if len(capsules) == len(rows):
            upper, fore, hand = (capsule.length for capsule in capsules)
            found.append(ArmFollower(name, rows[0], rows[1], rows[2], (upper, fore, hand)))
    return found


def _end(pose: Array, along: float) -> Array:
    return np.asarray(pose[:3, 3] + along * pose[:3, 2])


def _span(pose: Array, low: Array, high: Array) -> None:
    """Turns a capsule the least that brings its axis from `low` to `high`, and puts it between."""
    z = (high - low) / max(float(np.linalg.norm(high - low)), 1e-12)
    pose[:3, :3] = least_rotation(pose[:3, 2], z) @ pose[:3, :3]
    pose[:3, 3] = 0.5 * (low + high)

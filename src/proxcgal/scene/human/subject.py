"""Virtual operators: what is drawn of each, and the sizes that follow from published tables.

Segment lengths as shares of stature: R. Drillis and R. Contini, Body Segment Parameters (1966), as
printed in D. A. Winter, Biomechanics and Motor Control of Human Movement. Segment masses and
densities: Winter, anthropometric data; a capsule is as thick as the cylinder that has its
segment's length and volume.
"""

from dataclasses import dataclass

import numpy as np

# Of stature.
HIP, SHOULDER, HEAD_TOP = 0.530, 0.818, 1.0  # heights
SHOULDERS, HIPS = 0.129, 0.0955  # half breadths
THIGH, SHIN = 0.245, 0.246
UPPER_ARM, FOREARM, HAND = 0.186, 0.146, 0.108
ARM = UPPER_ARM + FOREARM + HAND

#: Segment: length as a share of stature, mass as a share of the body's, density [kg/m^3].
_SEGMENTS = {
    "head": (HEAD_TOP - SHOULDER, 0.081, 1110.0),
    "torso": (SHOULDER - HIP, 0.497, 1030.0),
    "upper_arm": (UPPER_ARM, 0.028, 1070.0),
    "forearm": (FOREARM, 0.016, 1130.0),
    "hand": (HAND, 0.006, 1160.0),
    "thigh": (THIGH, 0.100, 1050.0),
    "shin": (SHIN, 0.0465, 1090.0),
}
BODY_MASS_INDEX = 23.0  # [kg/m^2] of all subjects
SIGNALS = 8  # reaction times drawn for each


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """One virtual operator, as drawn from a seed."""

    stature: float  #: [m]
    arm_length: float  #: [m] shoulder to fingertips
    walking_speed: float  #: [m/s]
    reach_speed: float  #: [m/s] at most, of a hand against the torso
    stretch: float  #: stance: share of the arm's length that is used to reach
    turn: float  #: stance: [rad] the reaching shoulder is turned towards the place
    aside: tuple[float, float]  #: stance: [m] from the mark on the floor
    reactions: tuple[float, ...]  #: [s] after each signal; they begin again after the last
    left_handed: bool = False

    @property
    def side(self) -> float:
        """Of the reaching hand: 1 left, -1 right."""
        return 1.0 if self.left_handed else -1.0

    @property
    def upper_arm(self) -> float:
        """Shoulder to elbow [m]."""
        return self.arm_length * UPPER_ARM / ARM

    @property
    def forearm(self) -> float:
        """Elbow to wrist [m]."""
        return self.arm_length * FOREARM / ARM

    @property
    def hand(self) -> float:
        """Wrist to fingertips [m]."""
        return self.arm_length * HAND / ARM


def draw_subject(number: int, seed: int = 0) -> Subject:
    """Virtual subject of that number, the same for the same seed.

    Every value is uniform in its bounds: stature 1.55 to 1.95 m, arms 0.44 of it within 5 %,
    walking 0.8 to 1.4 m/s, reaching 0.7 to 1.3 m/s, reactions 0.2 to 0.8 s; one in ten is
    left-handed.

    Args:
        number: from 1.
        seed: of all subjects.
    """
    draw = np.random.default_rng([seed, number, _STREAM])
    stature = draw.uniform(1.55, 1.95)
    return Subject(
        stature=float(stature),
        arm_length=float(stature * ARM * draw.uniform(0.95, 1.05)),
        walking_speed=float(draw.uniform(0.8, 1.4)),
        reach_speed=float(draw.uniform(0.7, 1.3)),
        stretch=float(draw.uniform(0.82, 0.95)),
        turn=float(draw.uniform(0.1, 0.4)),
        aside=(float(draw.uniform(-0.05, 0.05)), float(draw.uniform(-0.05, 0.05))),
        reactions=tuple(float(delay) for delay in draw.uniform(0.2, 0.8, SIGNALS)),
        left_handed=bool(draw.random() < 0.1),
    )


_STREAM = 0x48756D  # of the seed: noise and jitter draw from others


def radius(segment: str, stature: float) -> float:
    """Of a segment's capsule [m]: head, torso, upper_arm, forearm, hand, thigh or shin."""
    length, mass, density = _SEGMENTS[segment]
    volume = mass * BODY_MASS_INDEX * stature**2 / density
    return float(np.sqrt(volume / (np.pi * length * stature)))

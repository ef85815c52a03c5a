"""Position, speed and acceleration limits: those of the built-in robots, and a user's own."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from proxcgal.core.errors import ModelError
from proxcgal.core.typing import Array
from proxcgal.models.description import Joint, RobotDescription, listed

PerJoint = float | Sequence[float] | Mapping[str, float]

# Time from rest to full speed that is assumed where nothing is known of a joint's acceleration [s].
# Chosen: the Panda's published limits give 0.13 to 0.29 s, the painting robot of [WT] needs 0.44 s
# (200 deg/s at 450 deg/s^2), the UR10e with the values below 0.42 to 0.63 s.
RAMP_TIME = 0.4
# The same for an arm of the KR 150's size. Chosen: no figure is published.
HEAVY_RAMP_TIME = 0.5


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of one robot, joint by joint in the order of q, and where they come from."""

    q_min: tuple[float, ...]  # [rad]
    q_max: tuple[float, ...]  # [rad]
    qd_max: tuple[float, ...]  # [rad/s]
    qdd_max: tuple[float, ...]  # [rad/s^2]
    source: str


def _radians(*degrees: float) -> tuple[float, ...]:
    return tuple(float(value) for value in np.radians(degrees))


_KR150_SPEED = _radians(110, 110, 100, 170, 170, 238)

LIMITS = {
    "ur10e": Limits(
        q_min=_radians(-360, -360, -180, -360, -360, -360),
        q_max=_radians(360, 360, 180, 360, 360, 360),
        qd_max=_radians(120, 120, 180, 180, 180, 180),
        qdd_max=(5.0,) * 6,
        source="position and speed: Universal Robots, UR10e user manual and ur_description; "
        "acceleration: chosen, none is published; 5 rad/s^2 is what the maker's MoveIt "
        "configuration takes, as a careful value",
    ),
    "panda": Limits(
        q_min=(-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973),
        q_max=(2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973),
        qd_max=(2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61),
        qdd_max=(15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0),
        source="Franka Emika, Panda: control parameters specifications (limits for Panda)",
    ),
    "kr150": Limits(
        q_min=_radians(-185, -146, -119, -350, -125, -350),
        q_max=_radians(185, 0, 155, 350, 125, 350),
        qd_max=_KR150_SPEED,
        qdd_max=tuple(speed / HEAVY_RAMP_TIME for speed in _KR150_SPEED),
        source="position and speed: KUKA KR 150-2, as in the kuka_kr150_support description; "
        f"acceleration: chosen, none is published; full speed in {HEAVY_RAMP_TIME} s",
    ),
}


def with_limits(
    description: RobotDescription,
    known: Limits | None,
    speed_limits: PerJoint | None,
    acceleration_limits: PerJoint | None,
) -> RobotDescription:
    """The description with all limits in place: the user's first, then the known, then the file's.

    Raises:
        ModelError: a joint without speed limit, a limit that is not above 0, an unknown joint.
    """
    names = description.joint_names
    joints = list(description.joints)
    if known is not None:
        columns = zip(known.q_min, known.q_max, known.qd_max, known.qdd_max, strict=True)
        joints = [
            replace(joint, q_min=low, q_max=high, qd_max=speed, qdd_max=acceleration)
            for joint, (low, high, speed, acceleration) in zip(joints, columns, strict=True)
        ]
    speeds = _spread(speed_limits, names, "speed_limits", description.name)
    accelerations = _spread(acceleration_limits, names, "acceleration_limits", description.name)
    joints = [replace(joint, qd_max=speeds.get(joint.name, joint.qd_max)) for joint in joints]
    if without := [joint.name for joint in joints if not 0 < joint.qd_max < np.inf]:
        raise ModelError(
            f"{description.source}: no speed limit for joint {listed(without)}; give them as "
            "speed_limits= (rad/s or m/s; one number, one for each joint, or by name), or under "
            "[limits] of the scenario file"
        )

    def acceleration(joint: Joint) -> float:
        found = accelerations.get(joint.name, joint.qdd_max)
        return joint.qd_max / RAMP_TIME if np.isnan(found) else found

    joints = [replace(joint, qdd_max=acceleration(joint)) for joint in joints]
    return replace(description, joints=tuple(joints))


def _numbers(value: object, what: str) -> Array:
    """(n,) of one number or a list of them."""
    try:
        return np.atleast_1d(np.asarray(value, dtype=np.float64)).ravel()
    except (TypeError, ValueError):
        raise ModelError(
            f"{what} = {value!r}; one number, one for each joint, or numbers by joint name"
        ) from None


def _spread(
    value: PerJoint | None, names: Sequence[str], what: str, robot: str
) -> dict[str, float]:
    """Limits by joint name, out of one number, one for each joint, or some by name."""
    if value is None:
        return {}
    if isinstance(value, Mapping):
        if unknown := [name for name in value if name not in names]:
            raise ModelError(
                f"{what}: robot '{robot}' has no joint {listed(unknown)}; it has {listed(names)}"
            )
        given = _numbers(list(value.values()), what)
        limits = dict(zip(value, given.tolist(), strict=True))
    else:
        given = _numbers(value, what)
        if np.ndim(value) == 0:
            given = np.repeat(given, len(names))
        if len(given) != len(names):
            raise ModelError(
                f"{what} has {len(given)} values; robot '{robot}' has {len(names)} joints: "
                f"{listed(names)}"
            )
        limits = dict(zip(names, given.tolist(), strict=True))
    for name, limit in limits.items():
        if not 0 < limit < np.inf:
            raise ModelError(f"{what} of joint '{name}' is {limit}; a finite number above 0")
    return limits

"""Sensor layouts: rings of sensors round a link, on its own surface."""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from proxcgal import _core
from proxcgal.core.errors import ConfigError, GeometryError, ModelError
from proxcgal.core.typing import Array, Ints
from proxcgal.models.formats.safe_xml import FARTHEST
from proxcgal.models.mesh.triangles import is_number
from proxcgal.models.robots import Robot

_AXES = ("x", "y", "z")
# Two longest sides are equal within this share; a link is flat whose third is below this one.
_EQUAL = 0.05
_FLAT = 0.8


def ring_skin(
    robot: Robot,
    link: str,
    at: float | Sequence[float] = (0.2, 0.5, 0.8),
    sensors: int = 10,
    standoff: float = 0.01,
    model: _core.SensorModel | None = None,
    phase: float = 0.0,
    axis: Literal["x", "y", "z"] | None = None,
) -> _core.Skin:
    """Rings of sensors round a link, each sensor on the link's full-resolution outer surface.

    The link's axis is the longest side of its bounding box in the link frame; a flat link, with two
    longest sides, has none, and its axis is the short side, round which a ring fits. A ring lies in
    the plane across it; its centre is that of the link's outline there. Sensors are even in angle,
    and face away from the centre: the rigid cover that carries a ring is round, so its sensors
    point radially whatever small features the shell below has. z is that direction, x the axis
    away from the joint that moves the link, y runs round the ring.

    Angle 0 is the direction of that joint's axis (where the link's axis runs along it, the link
    frame's own next axis), and angles turn right-handed about the link's axis.

    Args:
        robot: see `load_robot`.
        link: one of `robot.link_names`.
        at: fractions of the link's length, 0 at the end nearer to the joint that moves it, one ring
            each.
        sensors: of each ring.
        standoff: height of the sensors above the surface, for the cover they sit in [m].
        model: of all sensors.
        phase: turns each ring about the link's axis [rad].
        axis: of the link frame, where the rings are to go round another than the link's.

    Returns:
        mounts named link/ring/sensor, such as "forearm_link/ring0/3"; skins join with +.

    Raises:
        ModelError: no such link; lists those there are.
        GeometryError: a fraction outside [0, 1], no sensor, or no surface where one would sit.
        ConfigError: an axis that is none of x, y, z.

    Source: [WA] III: rings of VL53L8CX boards in printed covers round the arm.
    """
    vertices, triangles = robot.full_mesh(link)
    try:
        fractions = np.atleast_1d(np.asarray(at, dtype=np.float64)).ravel().tolist()
    except (TypeError, ValueError):
        raise GeometryError(f"at = {at!r}; fractions of the link's length are needed") from None
    if outside := [fraction for fraction in fractions if not 0 <= fraction <= 1]:
        raise GeometryError(f"ring at {outside[0]} of link '{link}'; 0 to 1 is needed")
    if not (fractions and isinstance(sensors, int | np.integer) and sensors >= 1):
        raise GeometryError(f"{len(fractions)} rings of {sensors} sensors; at least one of each")
    if not (
        is_number(standoff)
        and is_number(phase)
        and 0 <= standoff <= FARTHEST
        and np.isfinite(phase)
    ):
        raise GeometryError(f"standoff = {standoff} m, phase = {phase} rad; 0 or more, and finite")
    begin, along, length = _axis(robot, link, vertices, axis)
    across = _reference(robot, link, along)
    tree = _core.MeshTree(vertices, triangles)
    mounts = []
    for ring, fraction in enumerate(fractions):
        what = f"link '{link}', ring at {fraction:g}"
        height = float(begin @ along) + fraction * length
        centre = _centre(vertices, triangles, along, across, height, what)
        angles = phase + 2 * np.pi * np.arange(sensors) / sensors
        cos, sin = np.cos(angles)[:, None], np.sin(angles)[:, None]
        outward = cos * across + sin * np.cross(along, across)
        radius = _outer_radius(tree, vertices, centre, outward, what)
        for k in range(sensors):
            T_LS = np.eye(4)
            T_LS[:3, 0], T_LS[:3, 2] = along, outward[k]
            T_LS[:3, 1] = np.cross(outward[k], along)
            T_LS[:3, 3] = centre + (radius[k] + standoff) * outward[k]
            mounts.append(_core.Mount(f"{link}/ring{ring}/{k}", link, T_LS))
    return _core.Skin(mounts, model or _core.SensorModel())


def _axis(
    robot: Robot, link: str, vertices: Array, wanted: str | None
) -> tuple[Array, Array, float]:
    """Where the link begins (3,) [m], its unit axis away from there, and its length [m]."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    short, middle, k = np.argsort(high - low)
    shares = (high - low) / (high - low).max()
    if shares[middle] > 1 - _EQUAL and shares[short] < _FLAT:
        k = short
    if wanted is not None:
        if wanted not in _AXES:
            raise ConfigError(f"axis = {wanted!r}; one of {', '.join(_AXES)} is needed")
        k = _AXES.index(wanted)
    axis = np.zeros(3)
    axis[k] = 1.0
    begin, end = (low + high) / 2, (low + high) / 2
    begin[k], end[k] = low[k], high[k]
    found = robot.description.links[robot.description.link_row(link)]
    joint_L = np.linalg.inv(found.T_JL)[:3, 3]
    if np.linalg.norm(end - joint_L) < np.linalg.norm(begin - joint_L):
        return end, -axis, float(high[k] - low[k])
    return begin, axis, float(high[k] - low[k])


def _reference(robot: Robot, link: str, axis: Array) -> Array:
    """Unit direction of angle 0, across the link's axis: that of the joint that moves it."""
    found = robot.description.links[robot.description.link_row(link)]
    choices = [np.roll(axis, 1)]
    if found.joint >= 0:
        joint = robot.description.joints[found.joint]
        choices.insert(0, found.T_JL[:3, :3].T @ joint.axis)
    for direction in choices:
        across = direction - (direction @ axis) * axis
        if np.linalg.norm(across) > 0.1:
            return np.asarray(across / np.linalg.norm(across))
    raise ModelError(f"link '{link}': no direction across its axis")


def _centre(
    vertices: Array, triangles: Ints, axis: Array, across: Array, height: float, what: str
) -> Array:
    """Centre (3,) of the link's outline in the plane axis . x = height: middle of its extent."""
    # From each corner to the next, (3, f).
    start, end = triangles.T, np.roll(triangles.T, -1, axis=0)
    up = vertices @ axis - height
    cut = (up[start] < 0) != (up[end] < 0)
    p, q, a, b = vertices[start[cut]], vertices[end[cut]], up[start[cut]], up[end[cut]]
    outline = p + (a / (a - b))[:, None] * (q - p)
    if len(outline) < 3:
        raise GeometryError(f"{what}: no surface there")
    third = np.cross(axis, across)
    middle = [(outline @ d).min() / 2 + (outline @ d).max() / 2 for d in (across, third)]
    return np.asarray(height * axis + middle[0] * across + middle[1] * third)


def _outer_radius(
    tree: _core.MeshTree, vertices: Array, centre: Array, outward: Array, what: str
) -> Array:
    """Distance (n,) from the centre to the outermost surface in each direction [m]."""
    reach = float(np.linalg.norm(vertices - centre, axis=1).max()) + 0.1
    radius = np.asarray(reach - tree.first_hit(centre + reach * outward, -outward))
    if (missed := ~(radius > 0)).any():
        angle = np.degrees(np.arctan2(*outward[missed][0][::-1][:2]))
        raise GeometryError(
            f"{what}: no surface for {missed.sum()} of {len(outward)} sensors (the first at "
            f"{angle:.0f} deg); another place or phase is needed"
        )
    return radius

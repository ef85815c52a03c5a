"""Do the sensors sit where they are said to? Asked of what they see of the arm itself."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from proxcgal import _core
from proxcgal.core.errors import ConfigError
from proxcgal.core.typing import Array
from proxcgal.models.robots import Robot
from proxcgal.models.self_view import Body, View

#: Wrong by this much a mount must be found, where its sensor sees enough of the body.
SHIFT_M, TURN_RAD = 0.005, float(np.deg2rad(2.0))
#: A mount that is right may still be off by this much in each direction, one standard deviation.
_FIT = np.array([0.0003] * 3 + [0.0012] * 3)
#: What size an error is looked for: bounds what the fit makes of directions it hardly sees.
_WIDE = np.array([0.01] * 3 + [0.07] * 3)
_STEP = np.array([0.002] * 3 + [0.008] * 3)  # [m], [rad] of the finite differences
_SURFACE = 0.001  # [m] standard deviation of model, rounding and rays against the real surface
_SHARE = 0.25  # [-] of a step's change, by which both ways may differ: else an edge is near
_KINK = 0.001  # [m] the same, at least
_GATE = 0.06  # [m] what measures farther from the prediction is another thing
# Of the score, chi squared with 6 degrees of freedom: passed once in 10^6 by a right mount.
THRESHOLD = 38.2583
_SURE = 3.0902  # sigmas that miss one error in 1000 that counts as visible
_MIN_SCANS = 3  # that must tell of a zone
_EMPTY = 0.8  # share of scans without a target that leaves a zone empty
_MIN_ZONES = 4  # less is no view
_MIN_GAPS = 4  # zones that look through where the body must be
_ROUNDS = 3  # of the fit, so that its size is that of the error
_CLEAR = 4.0  # sigmas of one range
_AXES = ("x", "y", "z", "turn x", "turn y", "turn z")


@dataclass(frozen=True, slots=True, kw_only=True)
class MountCheck:
    """What one sensor's view of the body says of its mount."""

    sensor: int  #: row of the skin
    name: str
    zones: int  #: that see the body, away from its edges
    #: Of x, y, z and the turns about them, in the sensor's frame: those in which an error of 5 mm
    #: or 2 degrees would be found. None: this sensor cannot be judged at this posture.
    visible: tuple[str, ...]
    wrong: bool
    shift: float  #: [m] between the mount and where the views fit best, in visible directions
    turn: float  #: [rad] the same

    def __str__(self) -> str:
        """One line: which sensor, how far off."""
        size = f"{1000 * self.shift:.1f} mm and {np.rad2deg(self.turn):.1f} deg"
        return f"sensor {self.sensor} ({self.name}): off by about {size}, by {self.zones} zones"


@dataclass(frozen=True, slots=True, kw_only=True)
class MountChecks:
    """The check of all sensors; true where none was found wrong."""

    sensors: tuple[MountCheck, ...]

    @property
    def wrong(self) -> tuple[MountCheck, ...]:
        """Those that sit elsewhere."""
        return tuple(check for check in self.sensors if check.wrong)

    @property
    def judged(self) -> int:
        """How many could be judged at all: the others see too little of the body."""
        return sum(bool(check.visible) for check in self.sensors)

    def __bool__(self) -> bool:
        """True where none was found wrong."""
        return not self.wrong


def check_mounts(
    robot: Robot, skin: _core.Skin, q: object, scans: Iterable[_core.Scan]
) -> MountChecks:
    """Compares what each sensor sees of the arm itself with what its mount says that it must see.

    Rays are cast from the mounts against the links' full-resolution meshes, as Algorithm 1 does;
    what the zones measured, over all scans, is fitted by a small shift and turn of each mount. A
    mount is wrong where that fit explains the measurements better than noise can (generalised
    likelihood ratio; one right mount in 10^6 is called wrong). Zones near an edge of the body, and
    those with something over 60 mm before it, are left out: keep the arm free of what is nearer.

    A sensor that sees no body cannot be judged; nor can an error along what it sees, such as a
    shift along a flat shell. `visible` tells which directions are. An offset of a sensor's ranges
    cannot be told from a shift along its view.

    Args:
        robot: see `load_robot`.
        skin: the sensors where they are taken to be.
        q: (n_q,) where the arm stood still meanwhile.
        scans: of any sensors, in any order, at least 3 of each; 30 tell 5 mm and 2 degrees.

    Returns:
        One check per sensor; true where none is wrong.

    Raises:
        ConfigError: a scan of a sensor that the skin has not, a mount on an unknown link.

    Source: [WA] Algorithm 1 for the prediction; the test is ours (docs/sources.md).
    """
    ranges, sigma = _measured(skin, scans)
    body = Body(robot, np.asarray(robot.link_poses(q)))
    checks = []
    for row, mount in enumerate(skin.mounts):
        if mount.link not in robot.link_names:
            raise ConfigError(
                f"skin: {mount.name} is on link {mount.link!r}; {robot.name} has "
                f"{', '.join(robot.link_names)}"
            )
        T_WS = body.poses_W[robot.link_names.index(mount.link)] @ np.asarray(mount.T_LS)
        checks.append(
            _check(
                row, mount.name, View(body, skin.model, T_WS), skin.model, ranges[row], sigma[row]
            )
        )
    return MountChecks(sensors=tuple(checks))


def _measured(skin: _core.Skin, scans: Iterable[_core.Scan]) -> tuple[Array, Array]:
    """Mean range along z of each sensor's zones, (n, 64), and its sigma.

    The range is nan where too few scans tell, inf where they say that nothing is there.
    """
    total, count, empty, scanned = np.zeros((4, len(skin), 64))
    for scan in scans:
        if not 0 <= scan.sensor < len(skin):
            raise ConfigError(f"scan of sensor {scan.sensor}: the skin has 0 to {len(skin) - 1}")
        ranges, status = np.asarray(scan.ranges), np.asarray(scan.status)
        # Only what the sensor itself is sure of: 6 and 9 are half trusted, and not needed here.
        told = (status == 5) & (ranges >= skin.model.min_range) & (ranges <= skin.model.max_range)
        total[scan.sensor] += np.where(told, ranges, 0.0)
        count[scan.sensor] += told
        empty[scan.sensor] += status == 255
        scanned[scan.sensor] += 1
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(count >= _MIN_SCANS, total / count, np.nan)
        noise = np.maximum(skin.model.sigma_floor, skin.model.sigma_ratio * mean)
        sigma = np.hypot(noise / np.sqrt(count), _SURFACE)
    nothing = (scanned >= _MIN_SCANS) & (empty >= _EMPTY * scanned)
    return np.where(nothing, np.inf, mean), np.where(nothing, 1.0, sigma)


def _check(
    row: int, name: str, view: View, model: _core.SensorModel, ranges: Array, sigma: Array
) -> MountCheck:
    zones, predicted, slopes = _smooth(view, np.zeros(6), np.arange(64))
    noise = np.maximum(model.sigma_floor, model.sigma_ratio * predicted)
    # Near the ends of its reach a sensor reports one side of the noise only.
    whole = (predicted - _CLEAR * noise > model.min_range) & (
        predicted + _CLEAR * noise < model.max_range
    )
    whole &= np.isfinite(sigma[zones])
    seen = _Expected(zones[whole], predicted[whole], slopes[whole], sigma[zones[whole]])
    score, used, gaps = seen.judge(ranges)
    wrong = score > THRESHOLD or gaps >= max(_MIN_GAPS, used.size)
    at = _fitted(view, used, ranges, sigma) if wrong else np.zeros(6)
    return MountCheck(
        sensor=row, name=name, zones=int(used.size), visible=_visible(view, seen),
        wrong=bool(wrong), shift=float(np.linalg.norm(at[:3])), turn=float(np.linalg.norm(at[3:])),
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Expected:
    """What a sensor must see of the body where its mount is right."""

    zones: NDArray[np.intp]  # (n,)
    predicted: Array  # (n,) ranges [m]
    slopes: Array  # (n, 6) how they change with the mount
    sigma: Array  # (n,) of the measured means [m]

    def judge(self, ranges: Array) -> tuple[float, NDArray[np.intp], int]:
        """Score of the ranges (64,) against a right mount, zones it rests on, zones of a gap."""
        missing = ranges[self.zones] - self.predicted
        # Nothing can hide the body by being farther away than it: there the body is not.
        gaps = int((missing > _GATE).sum())
        usable = np.abs(missing) <= _GATE  # nan is not
        if usable.sum() < _MIN_ZONES:
            return 0.0, self.zones[usable], gaps
        slopes = self.slopes[usable]
        noise = np.diag(self.sigma[usable] ** 2) + (slopes * _FIT**2) @ slopes.T
        weighed = np.linalg.solve(noise, np.column_stack([slopes, missing[usable]]))
        towards = slopes.T @ weighed[:, 6]
        information = slopes.T @ weighed[:, :6] + 1e-9 * np.diag(1.0 / _WIDE**2)
        return float(towards @ np.linalg.solve(information, towards)), self.zones[usable], gaps


def _visible(view: View, seen: _Expected) -> tuple[str, ...]:
    """Axes along and about which an error of either sign would be found."""
    sizes = np.diag([SHIFT_M] * 3 + [TURN_RAD] * 3)
    if seen.zones.size < _MIN_ZONES:
        return ()
    views = np.full((12, 64), np.nan)
    views[:, seen.zones] = view(np.concatenate([sizes, -sizes]), seen.zones)
    scores = np.array([seen.judge(ranges)[0] for ranges in views]).reshape(2, 6)
    # Patnaik: the root of a large chi squared is about normal, with unit variance.
    found = np.sqrt(scores).min(axis=0) > np.sqrt(THRESHOLD) + _SURE
    return tuple(axis for axis, sure in zip(_AXES, found, strict=True) if sure)


def _smooth(
    view: View, at: Array, zones: NDArray[np.intp]
) -> tuple[NDArray[np.intp], Array, Array]:
    """Zones that see one smooth piece of the body; their ranges; how these move with the mount."""
    seen = view(at[None], zones)[0]
    zones, seen = zones[np.isfinite(seen)], seen[np.isfinite(seen)]
    if not zones.size:
        return zones, seen, np.empty((0, 6))
    steps = np.concatenate([np.diag(_STEP), -np.diag(_STEP)])
    moved = view(at + steps, zones)
    with np.errstate(invalid="ignore"):
        ahead, behind = moved[:6] - seen, seen - moved[6:]
        kink = np.abs(ahead - behind)
        change = np.maximum(np.abs(ahead), np.abs(behind))
        smooth = (np.isfinite(change) & (kink <= np.maximum(_KINK, _SHARE * change))).all(axis=0)
        slopes = ((ahead + behind) / (2.0 * _STEP[:, None])).T
    return zones[smooth], seen[smooth], slopes[smooth]


def _fitted(view: View, zones: NDArray[np.intp], ranges: Array, sigma: Array) -> Array:
    """Where the mount must be for what was seen, as near to where it should be as that allows."""
    at: Array = np.zeros(6)
    for _ in range(_ROUNDS):
        chosen, seen, slopes = _smooth(view, at, zones)
        if not chosen.size:
            break
        weight = 1.0 / sigma[chosen] ** 2
        missing = ranges[chosen] - seen + slopes @ at
        information = (slopes.T * weight) @ slopes + np.diag(1.0 / _WIDE**2)
        at = np.asarray(np.linalg.solve(information, slopes.T @ (weight * missing)), np.float64)
    return at

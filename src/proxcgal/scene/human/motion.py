"""What a virtual subject does on a timeline: walks, turns, leans, reaches."""

from dataclasses import dataclass, field

import numpy as np

from proxcgal.core.errors import ConfigError
from proxcgal.core.typing import Array
from proxcgal.scene.human import gait
from proxcgal.scene.human.body import POINTS
from proxcgal.scene.human.operator_keys import Operator, Step
from proxcgal.scene.human.smooth import Glide, Track, least_duration, minimum_jerk, slerp, two_bones
from proxcgal.scene.human.stance import (
    CARRYING,
    HANGING,
    STEP,
    Stance,
    hip,
    reaching,
    shoulder,
    stance_for,
    torso,
)
from proxcgal.scene.human.subject import HEAD_TOP, HIP, HIPS, SHIN, SHOULDER, THIGH, Subject, radius

HZ = 100.0  # of the grid that a motion is laid out on
WALKING_ACCELERATION = 3.0  # [m/s^2]
REACHING_ACCELERATION = 6.0  # [m/s^2] of a hand against the torso
TURNING = (2.2, 6.0)  # [rad/s], [rad/s^2]
LEANING = (1.2, 4.0)  # [rad/s], [rad/s^2]
FAR = 0.6  # [m] ways longer than this are walked face forward
WORK_M, WORK_HZ = 0.008, 0.7  # the hand goes round like this while it works


@dataclass(frozen=True, slots=True)
class Motion:
    """Where every point of a body is, over time."""

    time: Array  #: (n,) [s] rising
    points_W: Array  #: (n, POINTS, 3) [m]
    stature: float  #: [m] which the capsules' radii follow


@dataclass(slots=True)
class _Plan:
    """All that moves, each on its own track."""

    side: float
    lean: Track
    yaw: Track
    ways: list[tuple[Glide, Array]] = field(default_factory=list)  # with the change (2,) [m]
    walks: list[gait.Walk] = field(default_factory=list)
    arms: list[tuple[float, float, Array, Array]] = field(default_factory=list)
    work: list[tuple[float, Array]] = field(default_factory=list)


def move(subject: Subject, operator: Operator, duration: float) -> Motion:
    """A virtual subject on an operator's timeline.

    Args:
        subject: who.
        operator: places, marks, signals.
        duration: [s] of the motion.

    Raises:
        ConfigError: a place that the subject cannot reach from its mark, or not in time.
    """
    time = np.arange(int(np.ceil(duration * HZ)) + 1) / HZ
    start = np.array(operator.marks[operator.start]) + subject.aside
    first = np.array(operator.marks[operator.timeline[0].mark]) + subject.aside
    here = Stance(start, _facing(start, first))
    plan = _Plan(subject.side, Track(0.0), Track(here.yaw))
    rest = HANGING
    ready = 0.0
    for row, step in enumerate(operator.timeline):
        begin = max(step.at + subject.reactions[row % len(subject.reactions)], ready)
        there = _goal(subject, operator, row, step, here)
        ready, rest = _go(subject, operator, plan, step, begin, here, there, rest)
        late = ready - step.at - step.within
        if late > 0.0:
            raise ConfigError(
                f"operator.timeline.{row}.within = {step.within:g}: subject {operator.subject} "
                f"(draw {operator.draw}) needs {step.within + late:.1f} s"
            )
        here = there
    return Motion(time, _points(subject, operator, plan, start, time), subject.stature)


def _goal(subject: Subject, operator: Operator, row: int, step: Step, here: Stance) -> Stance:
    mark = np.array(operator.marks[step.mark])
    if step.reach is None:
        feet = mark + subject.aside
        return Stance(feet, _facing(here.feet, feet))
    place = np.array(operator.places[step.reach])
    stance = stance_for(subject, subject.side, operator.floor, mark, place)
    if stance is None:
        raise ConfigError(
            f"operator.timeline.{row}: subject {operator.subject} (draw {operator.draw}, "
            f"{subject.stature:.2f} m) cannot reach {step.reach} from {step.mark}"
        )
    return stance


def _go(
    subject: Subject, operator: Operator, plan: _Plan, step: Step, begin: float, here: Stance,
    there: Stance, rest: Array,
) -> tuple[float, Array]:  # fmt: skip
    """Draws the arm in, walks, reaches out; when all of it is done, and the arm's rest then."""
    tucked = HANGING if rest is HANGING or step.reach is None else CARRYING
    drawn_in = begin + _swing(subject, plan, begin, rest, tucked)
    if plan.lean.last > 0.0:
        upright = max(least_duration(plan.lean.last, *LEANING), 0.3)
        drawn_in = max(drawn_in, plan.lean.go(begin, upright, 0.0))
    leave = begin + 0.4 * (drawn_in - begin)
    stops = [there]
    via = np.array(operator.marks[step.mark]) + subject.aside
    if np.linalg.norm(via - here.feet) > FAR and step.reach is not None:
        stops = [Stance(via, _facing(here.feet, via)), there]
    moving, moved = leave, leave
    for stop in stops:
        moved = _walk(subject, plan, moved, here, stop)
        here = stop
    if plan.walks and moving - plan.walks[-1].end < 2.0 * gait.EASE:
        moving = plan.walks.pop().start  # one gait for all that follows without a rest
    plan.walks.append(gait.Walk(moving, moved))
    if step.reach is None:
        return max(moved + gait.EASE, drawn_in), tucked
    pelvis, R_WT = torso(
        subject, operator.floor, there.feet[None], np.array([there.yaw]), np.array([there.lean]),
        np.zeros(1),
    )  # fmt: skip
    place_T = (np.array(operator.places[step.reach]) - pelvis[0]) @ R_WT[0]
    arm = reaching(subject, plan.side, place_T[None])[0]
    reach = _duration(subject, tucked, arm)
    lean = max(least_duration(there.lean, *LEANING), 0.3)
    # The last part of the way is walked with the arm on its way out.
    out = max(drawn_in, moved - 0.5 * max(reach, lean))
    _swing(subject, plan, out, tucked, arm)
    plan.lean.go(out, lean, there.lean)
    done = max(out + reach, out + lean, moved + gait.EASE)
    plan.work.append((done, place_T))
    return done, arm


def _facing(start: Array, end: Array) -> float:
    way = end - start
    return float(np.arctan2(way[1], way[0]))


def _walk(subject: Subject, plan: _Plan, begin: float, here: Stance, there: Stance) -> float:
    """The body goes from here to there; when it rests there [s]."""
    change = there.feet - here.feet
    length = float(np.linalg.norm(change))
    start = begin
    if length > FAR:  # face the way first
        turned = _turn(plan, begin, _facing(here.feet, there.feet))
        start = begin + 0.5 * (turned - begin)
    way = Glide.of(start, length, subject.walking_speed, WALKING_ACCELERATION)
    plan.ways.append((way, change))
    # On a short way the body turns as it goes, on a long one towards its end.
    turn = begin if length <= FAR else max(way.end - 0.4, turned)
    return max(way.end, _turn(plan, turn, there.yaw))


def _turn(plan: _Plan, begin: float, yaw: float) -> float:
    change = (yaw - plan.yaw.last + np.pi) % (2.0 * np.pi) - np.pi  # the shorter way round
    duration = max(least_duration(abs(change), *TURNING), 1e-3)
    return plan.yaw.go(begin, duration, plan.yaw.last + change)


def _duration(subject: Subject, start: Array, end: Array) -> float:
    """That keeps the hand within the subject's reach speed [s]."""
    turns = np.arccos(np.clip((start * end).sum(axis=1), -1.0, 1.0))
    lengths = np.array([subject.upper_arm, subject.forearm + subject.hand])
    arc = float(turns @ lengths)
    return max(least_duration(arc, subject.reach_speed, REACHING_ACCELERATION), 0.3)


def _swing(subject: Subject, plan: _Plan, begin: float, start: Array, end: Array) -> float:
    duration = _duration(subject, start, end)
    plan.arms.append((begin, duration, start, end))
    return duration


def _points(subject: Subject, operator: Operator, plan: _Plan, start: Array, time: Array) -> Array:
    """(n, POINTS, 3) of the whole plan [m]."""
    n = len(time)
    body = np.tile(start, (n, 1))
    for way, change in plan.ways:
        body += way.share(time)[:, None] * change
    yaw, lean = plan.yaw.at(time), plan.lean.at(time)
    stride = sum((walk.stride(time) for walk in plan.walks), np.zeros(n))
    pelvis, R_WT = torso(subject, operator.floor, body, yaw, lean, stride)
    spine = subject.stature * np.array([0.0, 0.0, 1.0])
    points = dict.fromkeys(POINTS, pelvis)
    points["neck"] = pelvis + R_WT @ ((SHOULDER - HIP) * spine)
    points["head"] = pelvis + R_WT @ ((HEAD_TOP - HIP) * spine)
    for name, side in (("left", 1.0), ("right", -1.0)):
        arm = _arm(subject, plan, time) if side == plan.side else np.tile(HANGING, (n, 1, 1))
        upper, lower = (np.einsum("nij,nj->ni", R_WT, arm[:, bone]) for bone in range(2))
        root = pelvis + R_WT @ shoulder(subject, side)
        elbow = root + subject.upper_arm * upper
        points[f"{name}_shoulder"], points[f"{name}_elbow"] = root, elbow
        points[f"{name}_wrist"] = elbow + subject.forearm * lower
        points[f"{name}_hand"] = elbow + (subject.forearm + subject.hand) * lower
    _legs(subject, operator, plan, time, body, yaw, pelvis, points)
    return np.stack([points[name] for name in POINTS], axis=1)


def _arm(subject: Subject, plan: _Plan, time: Array) -> Array:
    """(n, 2, 3) directions of the reaching arm's bones, in the torso's frame."""
    arm = np.tile(plan.arms[0][2], (len(time), 1, 1))
    for begin, duration, start, end in plan.arms:
        share = (time - begin) / duration
        active = share > 0.0
        moved = minimum_jerk(share[active])
        for bone in range(2):
            arm[active, bone] = slerp(start[bone], end[bone], moved)
    draws = [begin for begin, *_ in plan.arms]
    for done, place_T in plan.work:
        stop = min([b for b in draws if b > done], default=float(time[-1]))
        inside = (time > done) & (time < stop)
        passed, left = time[inside] - done, stop - time[inside]
        envelope = minimum_jerk(passed / 1.0) * minimum_jerk(left / 1.0)
        angle = 2.0 * np.pi * WORK_HZ * passed
        round_T = np.stack([np.zeros_like(angle), np.sin(angle), np.cos(angle)], axis=1)
        arm[inside] = reaching(subject, plan.side, place_T + WORK_M * envelope[:, None] * round_T)
    return arm


def _legs(
    subject: Subject, operator: Operator, plan: _Plan, time: Array, body: Array, yaw: Array,
    pelvis: Array, points: dict[str, Array],
) -> None:  # fmt: skip
    stature = subject.stature
    steps = gait.feet(time, plan.walks, body, yaw, HIPS * stature, STEP * stature)
    ahead = np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)], axis=1)
    left = np.stack([-np.sin(yaw), np.cos(yaw), np.zeros_like(yaw)], axis=1)
    for foot, name, side in zip(steps, ("left", "right"), gait.SIDES, strict=True):
        root = pelvis + left * hip(subject, side)[1]
        ankle = foot + np.array([0.0, 0.0, operator.floor + radius("shin", stature)])
        points[f"{name}_hip"], points[f"{name}_ankle"] = root, ankle
        points[f"{name}_knee"] = two_bones(root, ankle, THIGH * stature, SHIN * stature, ahead)

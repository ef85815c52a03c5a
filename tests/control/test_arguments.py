"""What a user may get wrong in a call: told by name, with what was given and what is allowed."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import proxcgal as px
from proxcgal import _core

NAN = float("nan")
CORNERS = np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
POINTS = np.array([[0.5, 0.0, 0.0], [0.0, 0.6, 0.1]])
HERE = np.eye(4)
# More than joints can be: what is written past their storage would be another variable's.
TOO_MANY = np.ones(100)


def one_joint() -> _core.Robot:
    joint = px.JointSpec("turn", origin=HERE, axis=[0, 0, 1], qd_max=1.0, qdd_max=5.0)
    links = [
        px.LinkSpec("base", -1, HERE, CORNERS - np.array([0, 0, 1]), FACES),
        px.LinkSpec("arm", 0, HERE, CORNERS, FACES),
    ]
    return _core.Robot("one", [joint], links, "tool", 0, HERE)


ROBOT = one_joint()
TREE = ROBOT.tree("arm")
Q = np.zeros(1)
AT_REST = px.Controller(ROBOT, px.Skin([]))


def tick(q: Any = Q, goal: Any = HERE) -> Any:
    return AT_REST.tick(0.0, q, [], goal)


def known(points: Any) -> Any:
    return AT_REST.tick_known(0.0, Q, points, HERE)


def body(tolerance: Any = 0.02, min_hit: float = 0.005) -> Any:
    return px.remove_body(ROBOT, Q, POINTS, POINTS + 0.1, tolerance, min_hit)


# The call, and what its message says: name, what was given, what is allowed.
WRONG: list[tuple[Callable[[], Any], str]] = [
    (lambda: tick(np.zeros(1, np.float32)),
     "q is array of type float32, expected C-contiguous (1,) float64"),
    (lambda: tick([0.0]), "q is list, expected C-contiguous (1,) float64"),
    (lambda: tick(goal=np.asfortranarray(HERE + np.tri(4))),
     "goal is a not C-contiguous array of type float64, expected C-contiguous (4, 4) float64"),
    (lambda: known(POINTS[::-1]),
     "points_W is a not C-contiguous array of type float64, expected C-contiguous (n, 3) float64"),
    (lambda: ROBOT.link_poses(np.zeros(2)), "q has shape (2,), expected (1,) float64"),
    (lambda: ROBOT.link_poses("x"), "q is str, expected (1,) float64"),
    (lambda: ROBOT.link_poses(np.ones(1) + 1j),
     "q is array of type complex128, expected (1,) float64"),
    (lambda: TREE.closest(POINTS * 1j),
     "points_L is array of type complex128, expected (n, 3) float64"),
    (lambda: px.MeshTree(CORNERS, [[0, 1], [2]]),
     "triangles is list that is no array, expected integers of shape (f, 3)"),
    (lambda: body(tolerance=[0.01, -0.5]), "tolerance is -0.5, must be finite, 0 m or more"),
    (lambda: body(tolerance=NAN), "tolerance is nan, must be finite, 0 m or more"),
    (lambda: body(min_hit=np.inf), "min_hit is inf, must be finite, 0 m or more"),
    (lambda: px.closest_pair(ROBOT, Q, POINTS, steps=-1),
     "steps is -1, must be 0 or more, or None"),
    (lambda: px.mesh_distance(ROBOT, Q, TREE, bound=NAN), "bound is nan, must be 0 m or more"),
    (lambda: px.self_distances(ROBOT, Q, [(0, 1)], bound=-1.0),
     "bound is -1, must be 0 m or more"),
    (lambda: TREE.distance(TREE, HERE, bound=-1.0), "bound is -1, must be 0 m or more"),
    (lambda: px.Capsule([1e200, 0, 0], [0, 0, 0], 0.1), "start is farther than 1e9 m"),
    (lambda: px.capsule_distances(np.full((1, 7), 1e200), np.zeros((1, 7))),
     "a row 0 must be finite and at most 1e9 m, its radius 0 m or more"),
    (lambda: px.capsule_distances(np.zeros((1, 7)), [[0, NAN, 0, 0, 0, 0, 1]]),
     "b row 0 must be finite and at most 1e9 m, its radius 0 m or more"),
    (lambda: px.IsoSeparation(human_speed=-1.0),
     "IsoSeparation.human_speed is -1 m/s, must be finite and at least 0 m/s"),
    (lambda: px.protective_distance(px.IsoSeparation(), NAN, 0.3),
     "robot_speed is nan, must be finite, 0 m/s or more"),
    (lambda: px.protective_distance(px.IsoSeparation(), 1.0, -0.3),
     "stop_time is -0.3, must be finite, 0 s or more"),
    (lambda: px.Admittance().step(np.zeros(6), True, NAN),
     "dt is nan, must be finite and above 0 s"),
    (lambda: px.Admittance().step(np.zeros(6), True, 0.0), "dt is 0, must be finite and above 0 s"),
    (lambda: px.HandGuide(ROBOT, qd_max=TOO_MANY),
     "qd_max has 100 rows, one a joint: at most 32 are supported"),
    (lambda: px.GuardConfig(capsules=[], q_reference=TOO_MANY),
     "q_reference has 100 rows, one a joint: at most 32 are supported"),
    (lambda: px.GuardConfig(capsules=[], q_reference=Q, qdd_max=TOO_MANY),
     "qdd_max has 100 rows, one a joint: at most 32 are supported"),
    (lambda: _core.Limiter(*[TOO_MANY] * 4),
     "qd_max has 100 rows, one a joint: at most 32 are supported"),
]  # fmt: skip


UR10E = "ur10e"
WRONG_MODELS: list[tuple[Callable[[], Any], str]] = [
    (lambda: px.load_robot(UR10E, vertices_per_link=7),
     "vertices_per_link = 7; a whole number from 8 to 1000000, or None"),
    (lambda: px.load_robot(UR10E, vertices_per_link=NAN), "vertices_per_link = nan; a whole"),
    (lambda: px.load_robot(UR10E, vertices_per_link=1000.5), "vertices_per_link = 1000.5; a whole"),
    (lambda: px.load_robot(UR10E, vertices_per_link="1000"), "vertices_per_link = '1000'; a whole"),
    # Halving edges up to so many would take the memory first.
    (lambda: px.load_robot(UR10E, vertices_per_link=2**70), "; a whole number from 8 to 1000000"),
    (lambda: px.load_robot(UR10E, max_deviation="2 mm"), "max_deviation = '2 mm'; a number above"),
    (lambda: px.load_robot(UR10E, max_deviation=NAN), "max_deviation = nan; a number above 0 [m]"),
    (lambda: px.load_robot(UR10E, speed_limits="fast"), "speed_limits = 'fast'; one number, one"),
    (lambda: px.load_robot(UR10E, acceleration_limits={"elbow_joint": None}),
     "acceleration_limits of joint 'elbow_joint' is nan; a finite number above 0"),
]  # fmt: skip


@pytest.mark.parametrize(("call", "told"), WRONG_MODELS, ids=[told for _, told in WRONG_MODELS])
def test_a_wrong_argument_of_load_robot_is_told_by_name(call: Callable[[], Any], told: str) -> None:
    with pytest.raises((px.ModelError, px.ConfigError)) as error:
        call()
    assert told in str(error.value)


@pytest.mark.parametrize(("call", "told"), WRONG, ids=[told for _, told in WRONG])
def test_a_wrong_argument_is_told_by_name(call: Callable[[], Any], told: str) -> None:
    with pytest.raises((px.GeometryError, px.ConfigError)) as error:
        call()
    assert told in str(error.value)


def test_a_refused_step_leaves_the_admittance_as_it_was() -> None:
    admittance = px.Admittance()
    admittance.step(np.full(6, 30.0), True, 0.01)
    before = admittance.velocity.copy()
    with pytest.raises(px.ConfigError):
        admittance.step(np.full(6, 30.0), True, NAN)
    np.testing.assert_array_equal(admittance.velocity, before)


def test_a_guard_needs_no_offset_of_the_operator() -> None:
    capsules = [px.LinkCapsule("arm", 1, px.Capsule([0, 0, 0], [0.1, 0, 0], 0.05))]
    inputs = {"capsules": capsules, "q_reference": Q}
    said = px.GuardConfig(**inputs, human_offset=[0.0, 0.0, 0.25])
    left_out = px.GuardConfig(**inputs)
    assert px.guard_contradictions(ROBOT, left_out) == px.guard_contradictions(ROBOT, said)
    elsewhere = px.GuardConfig(**inputs, human_offset=[0.0, 0.0, 2.0])
    assert px.guard_contradictions(ROBOT, elsewhere) != px.guard_contradictions(ROBOT, said)


def members(thing: object) -> list[tuple[str, object]]:
    """What a public class has of its own that a user reads or calls."""
    found = list(vars(thing).items()) if isinstance(thing, type) else []
    return [
        (name, member)
        for name, member in found
        if not name.startswith("_") and (callable(member) or isinstance(member, property))
    ]


def said_of(thing: object) -> str:
    """Its docstring, less the signatures that are generated."""
    lines = (thing.__doc__ or "").splitlines()
    return "".join(line for line in lines if "->" not in line).strip()


def test_every_public_name_and_what_it_holds_is_described() -> None:
    public = {name: getattr(px, name) for name in px.__all__}
    silent = [name for name, thing in public.items() if not said_of(thing)]
    silent += [
        f"{name}.{member}"
        for name, thing in public.items()
        for member, held in members(thing)
        if not said_of(held)
    ]
    assert silent == []

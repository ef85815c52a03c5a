"""A hand that is dragged keeps its arm together."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from proxcgal.core.transforms import pose, rotation_from_rpy
from proxcgal.scene.arm_follower import arm_followers
from proxcgal.scene.dragging import DraggedSolids, LiveScene
from proxcgal.scene.solids import CapsuleSolid, Solid, Sphere

LENGTHS = (0.30, 0.26, 0.10)
place = st.tuples(*[st.floats(-2.0, 2.0)] * 3)


class Standing:
    """Somebody who stands still, one arm hanging, z upwards."""

    names = ("head", "left_upper_arm", "left_forearm", "left_hand")
    solids: tuple[Solid, ...] = (Sphere(0.1), *(CapsuleSolid(0.04, length) for length in LENGTHS))
    still = True

    def poses(self, time: float) -> np.ndarray:
        tops = 1.4 - np.cumsum([0.0, *LENGTHS])
        middles = 0.5 * (tops[1:] + tops[:-1])
        return np.array([pose((0.0, 0.0, z)) for z in (1.7, *middles)])

    def twists(self, time: float) -> np.ndarray:
        return np.zeros((4, 6))


@given(place, place)
def test_a_dragged_hand_keeps_its_arm_together(
    position: tuple[float, ...], rpy: tuple[float, ...]
) -> None:
    hands = DraggedSolids(speed=100.0)
    scene = LiveScene(Standing(), hands)
    wanted = pose(position, rpy)
    hands.move("left_hand", scene.poses(0.0)[3], wanted)
    hands.advance(1.0)
    _, upper, fore, hand = scene.poses(0.0)
    ends = [
        (T[:3, 3] + 0.5 * length * T[:3, 2], T[:3, 3] - 0.5 * length * T[:3, 2])
        for T, length in zip((upper, fore, hand), LENGTHS, strict=True)
    ]
    assert np.allclose(ends[0][0], [0.0, 0.0, 1.4])  # the shoulder stays
    assert np.allclose(ends[0][1], ends[1][0])  # elbow
    assert np.allclose(ends[1][1], ends[2][0])  # wrist
    for T in (upper, fore, hand):
        assert np.allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3))
        assert np.isclose(np.linalg.det(T[:3, :3]), 1.0)
    assert np.allclose(hand[:3, :3], rotation_from_rpy(rpy))


def test_within_reach_the_hand_goes_where_it_is_wanted() -> None:
    hands = DraggedSolids(speed=100.0)
    scene = LiveScene(Standing(), hands)
    wanted = pose((0.3, 0.1, 1.2), (0.0, -1.5, 0.0))
    hands.move("left_hand", scene.poses(0.0)[3], wanted)
    hands.advance(1.0)
    assert np.allclose(scene.poses(0.0)[3], wanted)


def test_only_whole_arms_of_capsules_follow() -> None:
    scene = Standing()
    assert [arm.hand_name for arm in arm_followers(scene.names, scene.solids)] == ["left_hand"]
    assert arm_followers(("left_hand", "panel"), scene.solids[:2]) == []
    assert arm_followers(scene.names, (Sphere(0.1),) * 4) == []

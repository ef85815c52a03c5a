"""Virtual operators: bodies that keep together, motions that stay smooth, hands in their place."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

import proxcgal as px
from proxcgal.core.transforms import least_rotations_of_z
from proxcgal.scenario.hri_scenario import HriScenario
from proxcgal.scenario.loading import load_scenario
from proxcgal.scene.human.body import NAMES, PARTS, POINTS, poses, radii, segments
from proxcgal.scene.human.motion import HZ, Motion, move
from proxcgal.scene.human.person import Person, person_of
from proxcgal.scene.human.recorded import HEADER, read_motion, write_motion
from proxcgal.scene.human.smooth import Glide, Track, minimum_jerk, slerp, two_bones
from proxcgal.scene.human.subject import ARM, SHIN, THIGH, draw_subject

Array = NDArray[np.float64]

TASKS = ("hri_task1", "hri_task2")
SUBJECTS = range(1, 21)
EVERYBODY = [(task, subject) for task in TASKS for subject in SUBJECTS]
#: Speed [m/s] and acceleration [m/s^2] of a walking, leaning, reaching body; of swinging legs.
UPPER, LEGS = (2.5, 12.0), (6.0, 90.0)


def scenario_of(task: str, subject: int = 1) -> HriScenario:
    scenario = load_scenario(task, [f"operator.subject={subject}"])
    assert isinstance(scenario, HriScenario)
    return scenario


def motion_of(task: str, subject: int) -> Motion:
    return move(draw_subject(subject), scenario_of(task, subject).operator, 65.0)


def point(motion: Motion, name: str) -> Array:
    return motion.points_W[:, POINTS.index(name)]


@pytest.mark.parametrize(("task", "subject"), EVERYBODY)
def test_everybody_moves_smoothly_and_reaches_every_place_in_time(task: str, subject: int) -> None:
    motion, operator = motion_of(task, subject), scenario_of(task, subject).operator
    side = "left" if draw_subject(subject).left_handed else "right"
    hand = 0.5 * (point(motion, f"{side}_wrist") + point(motion, f"{side}_hand"))
    ends = [*(step.at for step in operator.timeline[1:]), 65.0]
    for step, end in zip(operator.timeline, ends, strict=True):
        there = (motion.time >= step.at + step.within) & (motion.time <= end)
        assert there.any()
        if step.reach is not None:
            apart = np.linalg.norm(hand[there] - operator.places[step.reach], axis=1)
            assert apart.max() < 0.02
        else:
            feet = 0.5 * (point(motion, "left_ankle") + point(motion, "right_ankle"))[there, :2]
            assert np.linalg.norm(feet - operator.marks[step.mark], axis=1).max() < 0.1
    speed = np.diff(motion.points_W, axis=0) * HZ
    change = np.diff(speed, axis=0) * HZ
    for row, name in enumerate(POINTS):
        bounds = LEGS if "knee" in name or "ankle" in name else UPPER
        assert np.linalg.norm(speed[:, row], axis=1).max() < bounds[0], name
        assert np.linalg.norm(change[:, row], axis=1).max() < bounds[1], name


@pytest.mark.parametrize(("task", "subject"), EVERYBODY[::7])
def test_one_foot_always_stands_still_on_the_floor(task: str, subject: int) -> None:
    motion = motion_of(task, subject)
    thickness = radii(motion.stature)[NAMES.index("left_shin")]
    still = []
    for side in ("left", "right"):
        ankle = point(motion, f"{side}_ankle")
        sole = ankle[:, 2] - thickness
        assert sole.min() > -0.8 - 1e-9
        assert sole.max() < -0.8 + 0.06
        moved = np.linalg.norm(np.diff(ankle, axis=0), axis=1)
        still.append((moved < 1e-4) & (sole[1:] < -0.8 + 1e-4))
    assert (still[0] | still[1]).all()


@pytest.mark.parametrize(("task", "subject"), EVERYBODY[::7])
def test_bones_keep_their_length(task: str, subject: int) -> None:
    motion, body = motion_of(task, subject), draw_subject(subject)
    for side in ("left", "right"):
        for start, end, length in (
            ("shoulder", "elbow", body.upper_arm),
            ("elbow", "wrist", body.forearm),
            ("wrist", "hand", body.hand),
            ("hip", "knee", THIGH * body.stature),
            ("knee", "ankle", SHIN * body.stature),
        ):
            bone = point(motion, f"{side}_{end}") - point(motion, f"{side}_{start}")
            np.testing.assert_allclose(np.linalg.norm(bone, axis=1), length, atol=1e-9)


def test_subjects_are_as_different_as_they_are_said_to_be() -> None:
    drawn = [draw_subject(number) for number in SUBJECTS]
    assert drawn == [draw_subject(number) for number in SUBJECTS]
    assert drawn[0] != draw_subject(1, seed=1)
    stature = np.array([subject.stature for subject in drawn])
    walking = np.array([subject.walking_speed for subject in drawn])
    assert 1.55 <= stature.min() < 1.65 < 1.85 < stature.max() <= 1.95
    assert 0.8 <= walking.min() < 0.95 < 1.25 < walking.max() <= 1.4
    arms = np.array([subject.arm_length for subject in drawn]) / stature
    assert 0.95 * ARM <= arms.min() < arms.max() <= 1.05 * ARM


def test_limbs_of_somebody_of_75_kg_are_as_thick_as_people_are() -> None:
    thickness = dict(zip(NAMES, radii(1.80), strict=True))
    assert 0.03 < thickness["left_forearm"] < 0.045
    assert 0.06 < thickness["right_thigh"] < 0.09
    assert 0.13 < thickness["torso"] < 0.18


def test_a_place_out_of_reach_is_told_with_subject_and_mark() -> None:
    scenario = load_scenario("hri_task1", ["operator.places.H1=[1.15, 0.55, 1.6]"])
    assert isinstance(scenario, HriScenario)
    with pytest.raises(px.ConfigError, match=r"timeline\.1: subject 1 .* cannot reach H1 from P1"):
        scenario.person()


def test_a_timeline_too_tight_for_somebody_is_told_with_what_they_need() -> None:
    scenario = load_scenario("hri_task1", ["operator.timeline.1.within=1.5"])
    assert isinstance(scenario, HriScenario)
    with pytest.raises(px.ConfigError, match=r"timeline\.1\.within = 1\.5: subject 1 .* needs"):
        scenario.person()


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ('operator.timeline.1.reach="H9"', "timeline.1.reach = 'H9' is not among"),
        ('operator.start="P9"', "start = 'P9' is not among P0, P1"),
        ("operator.timeline.2.at=5.0", "each must be later than the last"),
        ('operator.timeline.3.phase="H1"', "each name once"),
        ('operator.timeline.3.phase="cycle"', "'cycle' is the whole run"),
        ("goal.offset=[0,0,1]", "exactly one of offset, position and waypoints"),
    ],
)
def test_what_is_wrong_with_an_operator_is_told(change: str, told: str) -> None:
    with pytest.raises(px.ConfigError, match=told.replace(".", r"\.")):
        load_scenario("hri_task1", [change])


def test_the_person_is_made_once_for_the_trials_that_share_it() -> None:
    operator = scenario_of("hri_task2", 3).operator
    assert person_of(operator, 65.0) is person_of(operator.model_copy(), 65.0)


@settings(deadline=None, max_examples=60)
@given(time=st.floats(-1.0, 67.0))
def test_a_capsules_ends_move_as_its_twist_says(time: float) -> None:
    person = scenario_of("hri_task1", 2).person()
    step = 1e-4
    grid = np.round(time * HZ) / HZ
    time = time if abs(time - grid) > 2 * step else time + 4 * step  # rates are even between
    half = np.array([[0.0, 0.0, 0.5 * solid.length, 1.0] for solid in person.solids])
    for side in (-1.0, 1.0):
        ends_O = half * [1.0, 1.0, side, 1.0]
        before, after = (
            np.einsum("nij,nj->ni", person.poses(time + by), ends_O)[:, :3] for by in (-step, step)
        )
        twists, poses_W = person.twists(time), person.poses(time)
        arms = np.einsum("nij,nj->ni", poses_W[:, :3, :3], ends_O[:, :3])
        speed = twists[:, :3] + np.cross(twists[:, 3:], arms)
        # Shins swing with up to 90 m/s^2: a hundredth of a second makes that much of a difference.
        apart = np.abs(speed - (after - before) / (2 * step))
        assert apart.max() < 0.6
        assert np.median(apart) < 0.05


@settings(deadline=None, max_examples=60)
@given(along=st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3))
@example(along=(0.0, 2.0**-24, -1.0))  # all but straight down
def test_upright_brings_z_along_a_direction(along: tuple[float, float, float]) -> None:
    R = least_rotations_of_z(np.array(along))
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-6)
    assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-6)
    np.testing.assert_allclose(R[:, 2], np.array(along) / np.linalg.norm(along), atol=1e-12)


def test_capsules_end_where_the_body_ends() -> None:
    motion = motion_of("hri_task1", 4)
    thickness = radii(motion.stature)
    start, end = segments(motion.points_W[:1], thickness)
    T_WO = poses(start, end)[0]
    np.testing.assert_allclose(T_WO[:, :3, 3], 0.5 * (start + end)[0])
    for row, part in enumerate(PARTS):
        free = motion.points_W[0, POINTS.index(part.end)]
        expected = 0.0 if part.open_end else thickness[row]
        assert np.linalg.norm(free - end[0, row]) == pytest.approx(expected, abs=1e-9)


@settings(deadline=None, max_examples=100)
@given(length=st.floats(0.01, 5.0), speed=st.floats(0.2, 2.0), acceleration=st.floats(0.5, 6.0))
def test_a_glide_keeps_its_bounds_and_arrives(
    length: float, speed: float, acceleration: float
) -> None:
    glide = Glide.of(1.0, length, speed, acceleration)
    time = np.linspace(0.0, glide.end + 1.0, 20_001)
    way = length * glide.share(time)
    assert way[0] == 0.0
    assert way[-1] == pytest.approx(length)
    rate = np.gradient(way, time)
    assert rate.min() >= -1e-9
    assert rate.max() <= speed * 1.001
    assert np.abs(np.gradient(rate, time)).max() <= acceleration * 1.01


def test_a_track_rests_between_its_steps() -> None:
    track = Track(1.0)
    assert track.go(1.0, 2.0, 3.0) == 3.0
    track.go(4.0, 1.0, -1.0)
    np.testing.assert_allclose(track.at(np.array([0.0, 2.0, 3.5, 9.0])), [1.0, 2.0, 3.0, -1.0])
    np.testing.assert_allclose(minimum_jerk(np.array([-1.0, 0.5, 2.0])), [0.0, 0.5, 1.0])


def test_slerp_is_that_of_scipy() -> None:
    generator = np.random.default_rng(0)
    start, end = (v / np.linalg.norm(v) for v in generator.normal(size=(2, 3)))
    axis = np.cross(start, end)
    angle = np.arctan2(np.linalg.norm(axis), start @ end)
    turn = Rotation.from_rotvec([np.zeros(3), axis / np.linalg.norm(axis) * angle])
    share = np.linspace(0.0, 1.0, 11)
    expected = Slerp([0.0, 1.0], turn)(share).apply(start)
    np.testing.assert_allclose(slerp(start, end, share), expected, atol=1e-12)
    np.testing.assert_allclose(slerp(start, start, share), np.tile(start, (11, 1)))


def test_two_bones_meet_in_the_middle_joint_bent_towards_the_pole() -> None:
    generator = np.random.default_rng(1)
    root, tip = np.zeros((50, 3)), generator.uniform(-0.3, 0.3, (50, 3))
    pole = np.tile([1.0, 0.0, 0.0], (50, 1))
    joint = two_bones(root, tip, 0.30, 0.28, pole)
    np.testing.assert_allclose(np.linalg.norm(joint - root, axis=1), 0.30, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(tip - joint, axis=1), 0.28, atol=1e-9)
    assert ((joint * pole).sum(axis=1) >= 0.5 * (tip * pole).sum(axis=1) - 0.1).all()


def test_a_table_that_begins_with_a_byte_order_mark_is_read(tmp_path: Path) -> None:
    motion = motion_of("hri_task2", 5)
    path = tmp_path / "walk.csv"
    write_motion(Motion(motion.time[::50], motion.points_W[::50], motion.stature), path)
    plain = read_motion(path)
    path.write_text(path.read_text(encoding="utf-8"), encoding="utf-8-sig")
    np.testing.assert_array_equal(read_motion(path).points_W, plain.points_W)


def test_a_written_motion_is_read_back_and_played(tmp_path: Path) -> None:
    motion = motion_of("hri_task2", 5)
    path = tmp_path / "walk.csv"
    write_motion(Motion(motion.time[::5], motion.points_W[::5], motion.stature), path)
    back = read_motion(path)
    assert back.stature == pytest.approx(motion.stature, abs=1e-3)
    scenario = load_scenario("hri_task2", [f'operator.recording="{path}"'])
    assert isinstance(scenario, HriScenario)
    played, drawn = scenario.person(), Person(motion)
    for moment in (0.0, 12.35, 40.0, 64.9):
        np.testing.assert_allclose(
            played.poses(moment)[:, :3, 3], drawn.poses(moment)[:, :3, 3], atol=2e-3
        )


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "no column time, pelvis_x, pelvis_y, pelvis_z ..."),
        (",".join(HEADER[:-1]), "no column right_ankle_z"),
        (",".join(HEADER), "has 0 rows, needs at least 2"),
        (
            ",".join(HEADER) + "\n0," + ",".join("x" * 51),
            "line 2: pelvis_x = 'x': must be a number",
        ),
        (",".join(HEADER) + "\n0,1,2", "line 2: pelvis_z = '': must be a number"),
        (",".join(HEADER) + "\n0," + ",".join(["inf"] * 51), "within 100 m"),
        (",".join(HEADER) + 2 * ("\n0," + ",".join(["1"] * 51)), "time = 0 after 0: must rise"),
        (
            ",".join(HEADER) + "\n0," + ",".join(["1"] * 51) + "\n1," + ",".join(["1"] * 51),
            "must be 0.5 to 2.5 m",
        ),
    ],
)
def test_what_is_wrong_with_a_recording_is_told(tmp_path: Path, text: str, told: str) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(px.ConfigError) as error:
        read_motion(path)
    assert told in str(error.value)
    assert str(path) in str(error.value)


def test_a_recording_without_one_of_the_hands_is_told_with_moment_and_points(
    tmp_path: Path,
) -> None:
    motion = motion_of("hri_task2", 5)
    points_W = motion.points_W[::50].copy()
    points_W[3, POINTS.index("left_hand")] = points_W[3, POINTS.index("left_wrist")]
    path = tmp_path / "handless.csv"
    write_motion(Motion(motion.time[::50], points_W, motion.stature), path)
    with pytest.raises(px.ConfigError, match=r"time = 1\.5: left_wrist and left_hand"):
        read_motion(path)


def test_a_recording_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(px.ConfigError, match="No such file"):
        read_motion(tmp_path / "nobody.csv")

"""Self-collision and manipulability of two arms, stacks by name, and what held the arm."""

import numpy as np
import pytest

import proxcgal as px
from proxcgal.models import macro_micro
from proxcgal.scenario.joint_scenario import CONFIGURATIONS, JointScenario
from proxcgal.scenario.loading import load_scenario, parse_scenario
from proxcgal.scenario.setup import Setup
from proxcgal.study.joint.metrics import COLUMNS, joint_metrics
from proxcgal.study.trial_simulation import simulate_trial

NOTHING = np.empty((0, 3))
FOLDED = np.array(CONFIGURATIONS["free"])


@pytest.fixture(scope="module")
def joint() -> px.Robot:
    return px.load_robot("kr150_ur10e")


def tick(robot: px.Robot, tasks: list[object], q: np.ndarray) -> px.TickOutput:
    """What comes of a posture once the command has settled: the arm is held where it is."""
    config = px.ControllerConfig(tasks=tasks, monitor=px.MonitorConfig(following_tolerance=np.inf))
    ctrl = px.Controller(robot, px.Skin([], px.SensorModel()), config)
    for k in range(60):
        out = ctrl.tick_known(0.01 * k, q, NOTHING, robot.tool_pose(q))
    return out


def near_posture(robot: px.Robot, pairs: list[tuple[str, str]], within: float) -> np.ndarray:
    """The first random posture in which these links are near one another, not touching."""
    rng = np.random.default_rng(5)
    rows = [tuple(robot.link_names.index(name) for name in pair) for pair in pairs]
    while True:
        q = rng.uniform(np.maximum(robot.q_min, -3), np.minimum(robot.q_max, 3))
        if 0.02 < px.self_distances(robot, q, rows).min() < within:
            return q


def test_self_collision_pushes_the_nearest_links_apart_at_its_rate(joint: px.Robot) -> None:
    pairs = [
        pair for pair in macro_micro.watched_pairs(joint, 6, 0.05) if pair[0].startswith("kuka_")
    ]
    q = near_posture(joint, pairs, 0.06)
    rows = [tuple(joint.link_names.index(name) for name in pair) for pair in pairs]
    out = tick(joint, [px.SelfCollision(pairs=pairs, nearest=1)], q)
    before = px.self_distances(joint, q, rows)
    nearest = pairs[int(before.argmin())]
    assert set(out.own_links) == set(nearest)
    assert out.own_distance == pytest.approx(before.min(), abs=1e-9)
    # The row is the derivative of the distance, by finite differences, over its own norm.
    step = 1e-5
    opened = px.self_distances(joint, q + step * out.qd, rows)[int(before.argmin())]
    assert (opened - before.min()) / step > 0.0
    report = out.tasks[0]
    rate = 2.0 * (0.10 - before.min())
    got = (opened - before.min()) / step
    assert got == pytest.approx(rate * (1 - report.residual[0] / report.rate[0]), rel=0.02)


def test_self_collision_watches_the_upper_arm_only(joint: px.Robot) -> None:
    pairs = macro_micro.watched_pairs(joint, 6, 0.05)
    assert ("kuka_link_3", "ur10e_forearm_link") in pairs
    assert all(any(name.startswith("ur10e_") for name in pair) for pair in pairs)
    assert ("kuka_base_link", "kuka_link_3") not in pairs
    # Both turn about the flange's axis alone: they stay 0.14 m apart.
    assert ("kuka_link_5", "ur10e_shoulder_link") not in pairs


def test_where_nothing_is_near_self_collision_asks_for_nothing(joint: px.Robot) -> None:
    out = tick(joint, [px.SelfCollision(pairs=[("kuka_base_link", "ur10e_wrist_3_link")])],
               np.array(CONFIGURATIONS["free"]))  # fmt: skip
    assert out.own_links is None
    assert out.own_distance == np.inf
    assert len(out.tasks[0].rate) == 0
    assert np.abs(out.qd).max() < 1e-9


def test_links_that_are_none_are_refused_by_name(joint: px.Robot) -> None:
    for pairs, error, said in (
        ([("ur10e_hand", "kuka_link_1")], px.ModelError, "ur10e_hand"),
        ([("kuka_link_1", "kuka_link_1")], px.ConfigError, "beside itself"),
    ):
        with pytest.raises(error, match=said):
            tick(joint, [px.SelfCollision(pairs=pairs)], FOLDED)
    with pytest.raises(px.ConfigError, match=r"SelfCollision\.nearest is 0"):
        px.SelfCollision(nearest=0)


def test_an_arms_manipulability_is_a_share_of_its_largest(joint: px.Robot) -> None:
    first, joints = macro_micro.part(joint, 6, "micro")
    unit = macro_micro.largest_manipulability(joint, first, joints)
    rng = np.random.default_rng(1)
    q = rng.uniform(np.maximum(joint.q_min, -3), np.minimum(joint.q_max, 3))
    J = joint.tool_jacobian(q)[:, 6:]
    share = float(np.sqrt(np.linalg.det(J @ J.T))) / unit
    assert 0.0 < share < 1.0
    task = px.Manipulability(first_joint=first, joints=joints, unit=unit, target=0.9, low=2, high=3)
    report = tick(joint, [task], q).tasks[0]
    # Scaled to unit norm, so only its sign and what the rate is proportional to are left.
    assert report.rate[0] > 0.0
    for unit_of in (1.0, unit):
        rate = tick(joint, [px.Manipulability(first_joint=6, joints=6, unit=unit_of, target=1e-9,
                                              low=5, high=9)], q).tasks[0].rate[0]  # fmt: skip
        assert rate < 0.0
    with pytest.raises(px.ConfigError, match="macro_joints = 12"):
        macro_micro.part(joint, 12, "macro")


@pytest.mark.parametrize(
    ("changes", "levels"),
    [
        ([], ("joint_limits", "avoidance", "minimum_altitude", "reach")),
        (['controller.tasks=["thesis"]'], ("minimum_altitude", "avoidance", "reach")),
        (['controller.off=["avoidance"]'], ("joint_limits", "minimum_altitude", "reach")),
        (
            ['controller.tasks=["self_collision", "full"]', 'controller.off=["joint_limits"]'],
            ("self_collision", "avoidance", "minimum_altitude", "reach"),
        ),
    ],
)
def test_stacks_go_by_name_and_tasks_can_be_left_out(
    changes: list[str], levels: tuple[str, ...]
) -> None:
    assert load_scenario("joint_gate", changes).controller.levels == levels


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ('controller.tasks=["full", "reach"]', "tasks names one of them twice"),
        ('controller.off=["self_collision"]', "off names self_collision, but the tasks are"),
        ('initial=["folded"]', "initial names 'folded': configurations has free, jl, mob_mob"),
        ('initial=["free", "free"]', "initial names one of them twice"),
        ("finish.patience=0", "finish.patience = 0: must be greater than 0"),
    ],
)
def test_what_a_joint_scenario_cannot_mean_is_told(change: str, said: str) -> None:
    with pytest.raises(px.ConfigError, match=said):
        load_scenario("joint_gate", [change])


def test_mob_mob_ends_before_it_begins(joint: px.Robot) -> None:
    scenario = load_scenario("joint_gate", ['initial=["mob_mob"]'])
    with pytest.raises(px.ConfigError, match=r"configurations.mob_mob.1 = 0.785398: kuka_joint_a2"):
        Setup.of(scenario, joint)


def test_a_joint_scenario_written_out_is_the_same_again() -> None:
    scenario = load_scenario("joint_behind")
    assert isinstance(scenario, JointScenario)
    assert parse_scenario(scenario.to_toml(), "again") == scenario
    assert [start.initial for start in scenario.starts()] == [("free",), ("jl",)]


@pytest.mark.parametrize("init", ["free", "jl"])
def test_the_gate_is_passed_and_told_in_numbers(joint: px.Robot, init: str) -> None:
    scenario = load_scenario("joint_gate", [f'initial=["{init}"]', "simulation.control_hz=125.0"])
    numbers = joint_metrics(
        simulate_trial(scenario, "wb_known", 0, lambda _: None), scenario, joint
    )
    assert tuple(numbers) == COLUMNS
    assert numbers["succeeded"]
    assert numbers["true_min_m"] >= 0.05  # type: ignore[operator]
    assert 0.0 < numbers["macro_share"] < 1.0  # type: ignore[operator]


def test_a_trapped_run_ends_with_what_holds_it(joint: px.Robot) -> None:
    scenario = load_scenario("joint_behind", ['initial=["jl"]', "simulation.control_hz=125.0"])
    log = simulate_trial(scenario, "wb_known", 0, lambda _: None)
    assert log.ending is not None
    assert log.ending.outcome == "aborted"
    assert log.ending.reason.startswith("held off by the obstacle (ur10e_")
    assert "no progress for 5 s" in log.ending.reason
    holding = log.ending.holding
    assert holding is not None
    assert (holding.task, holding.obstacle) == ("avoidance", "cylinder")
    assert log.elapsed[-1] < 20.0  # never by running on
    assert log.true_m[np.isfinite(log.true_m)].min() >= 0.05
    assert log.task_names == scenario.controller.levels
    assert log.task_activation.shape == log.task_residual.shape == (len(log.time), 4)


def test_memory_keeps_the_wrist_off_what_only_the_forearm_saw(joint: px.Robot) -> None:
    # Half a second after it was seen last, slowly, no sensor looks where the wrist goes.
    scenario = load_scenario("joint_behind", ['perception="sensed"', 'initial=["jl"]'])
    log = simulate_trial(scenario, "wb_memory", 2, lambda _: None)
    assert log.summary()["true_min_m"] >= 0.05

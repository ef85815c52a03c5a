"""Goals for the 12-joint robot: refused before anything moves, or ended exactly once."""

import math
import threading
import time as clock
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

import proxcgal as px
from proxcgal.evaluation.termination import Ending
from proxcgal.server import pursuit
from proxcgal.server.goals import goal_pose, reach_of

REACHED = (3.0, 0.291, 1.05)
_robots: dict[str, px.Robot] = {}


def robot() -> px.Robot:
    if not _robots:
        _robots["joint"] = px.load_robot("kr150_ur10e")
    return _robots["joint"]


def server(scenario: str = "joint_free", *changes: str, **options: object) -> px.JointRobotServer:
    # 100 ticks a second are enough to see how goals end.
    overrides = ["simulation.control_hz=100.0", "simulation.known_spacing=0.05", *changes]
    return px.JointRobotServer(scenario, overrides, robot=robot(), **options)  # type: ignore[arg-type]


def test_a_goal_is_reached_and_its_feedback_says_how_it_goes() -> None:
    with server() as arm:
        number = arm.send_goal(px.JointGoal(translation=REACHED, init="jl"))
        for _ in range(100):
            arm.step()
        told = arm.feedback()
        assert told is not None
        assert (told.goal, told.state) == (number, "executing")
        assert told.linvel_norm > 0.1
        assert 0.1 < told.position_error_m < 1.7
        end = arm.wait(number)
        assert end is not None
        assert end.outcome == "succeeded"
        assert end.position_error_m <= 0.03
        assert end.angle_error_rad <= 0.05
        assert arm.feedback() is None


def test_the_arm_gives_its_state_and_takes_commands_as_every_source_does() -> None:
    with server() as joint_robot:
        arm = joint_robot._arm
        inputs = arm.read()
        assert inputs.known
        np.testing.assert_array_equal(inputs.q, arm.q)
        np.testing.assert_array_equal(inputs.goal, arm.tool)  # it holds still
        arm.command(np.full(12, 0.1))
        arm.move()
        np.testing.assert_allclose(arm.q, inputs.q + 0.1 * arm.period)


def test_a_server_that_was_closed_takes_nothing_on_and_does_not_start_again() -> None:
    with server("joint_free") as arm, pytest.raises(px.GoalRefusedError, match="a JointGoal"):
        arm.send_goal(None)  # type: ignore[arg-type]
    with pytest.raises(px.GoalRefusedError, match="was closed"):
        arm.send_goal(px.JointGoal(translation=REACHED, init="jl"))
    with pytest.raises(px.ConfigError, match="was closed"):
        arm.start()


def test_a_goal_held_off_by_an_obstacle_is_aborted_with_what_holds_it() -> None:
    with server("joint_cylinder_tight") as arm:
        number = arm.send_goal(px.JointGoal(translation=REACHED, init="jl"))
        end = arm.wait(number, timeout=60.0)
        assert end is not None
        assert end.outcome == "aborted"
        assert "held off by the obstacle" in end.reason
        assert "cylinder" in end.reason
        assert f"{end.position_error_m:.3f} m" in end.reason
        assert np.abs(arm.q).max() < 10.0


def test_ticks_go_on_while_it_is_found_out_what_held_the_arm(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    known = threading.Event()

    def slowly(_setup: object, ending: Ending, *_: object) -> Ending:
        assert known.wait(60.0)
        return replace(ending, reason="found out")

    monkeypatch.setattr(pursuit, "concluded", slowly)
    with server("joint_free", "finish.patience=0.2", "finish.progress=5.0") as arm:
        number = arm.send_goal(px.JointGoal(translation=REACHED, init="jl"))
        for _ in range(300):
            arm.step(wait=False)
        assert arm.result(number) is None
        stands = arm.q
        arm.step(wait=False)
        np.testing.assert_allclose(arm.q, stands, atol=1e-4)
        known.set()
        while (end := arm.result(number)) is None:
            arm.step(wait=False)
        assert (end.outcome, end.reason) == ("aborted", "found out")


@pytest.mark.parametrize(
    ("goal", "said"),
    [
        ({"translation": (math.nan, 0, 1)}, "translation = .*must be finite"),
        ({"translation": REACHED, "rpy": (0, math.inf, 0)}, "rpy = .*must be finite"),
        ({"translation": (1, 2)}, "must be three finite numbers"),
        ({"translation": "abc"}, "must be three finite numbers"),
        ({"translation": (10**400, 0, 0)}, "must be three finite numbers"),
        ({"translation": (10**5000, 0, 0)}, "must be three finite numbers"),
        ({"translation": (1e308, 1e308, 0)}, r"would be at \(1e\+308, 1e\+308, 0\) m, inf m from"),
        (
            {"translation": (1e308, 1e308, 1e308), "frame": "end_effector"},
            r"would be at .{5,60} m, inf m from",
        ),
        ({"translation": REACHED, "init": ["free"]}, "init = .*: there are free, jl, mob_mob"),
        (
            {"translation": REACHED, "init": "folded"},
            "init = 'folded': there are free, jl, mob_mob",
        ),
        ({"translation": REACHED, "frame": "world"}, "one of kuka_base, end_effector"),
        ({"translation": (9.0, 0, 1)}, "no posture reaches beyond"),
        (
            {"translation": REACHED, "init": "mob_mob"},
            "mob_mob.1 = 0.785398: kuka_joint_a2 of kr150_ur10e goes from -2.54818 to 0",
        ),
    ],
)
def test_a_bad_goal_is_refused_with_its_reason_and_nothing_moves(
    goal: dict[str, object], said: str
) -> None:
    with server() as arm:
        before = arm.q
        with pytest.raises(px.GoalRefusedError, match=said):
            arm.send_goal(px.JointGoal(**goal))  # type: ignore[arg-type]
        assert arm.feedback() is None
        np.testing.assert_array_equal(arm.q, before)


def test_cancel_brakes_within_the_acceleration_limits() -> None:
    with server() as arm:
        number = arm.send_goal(px.JointGoal(translation=REACHED))
        for _ in range(80):
            arm.step()
        assert arm.cancel(number)
        assert not arm.cancel(number)
        steps = [arm.q]
        while (end := arm.result(number)) is None:
            arm.step()
            steps.append(arm.q)
        speed = np.diff(steps, axis=0) / arm.period
        change = np.diff(speed, axis=0) / arm.period
        assert (np.abs(change) <= arm.robot.qdd_max * (1 + 1e-6)).all()
        assert end.outcome == "cancelled"
        assert np.abs(speed[-1]).max() < 0.02
        assert not arm.cancel(number)


def test_a_cancelled_goal_ends_once_only_what_goes_before_it_moves_the_arm() -> None:
    with server() as arm:  # in `jl` the tool is below the minimum altitude, and rises slowly
        number = arm.send_goal(px.JointGoal(translation=REACHED, init="jl"))
        for _ in range(80):
            arm.step()
        assert speed_across(arm) > 0.1
        assert arm.cancel(number)
        end = arm.wait(number)
        assert end is not None
        assert end.outcome == "cancelled"
        assert end.reason == "cancelled by the client; minimum_altitude still moves the arm"
        assert speed_across(arm) < 0.01
        assert 0.8 < end.time_s < 0.8 + 1.0
        q = arm.q
        for _ in range(10):
            arm.step()
        assert arm.robot.tool_pose(arm.q)[2, 3] > arm.robot.tool_pose(q)[2, 3]


def speed_across(arm: px.JointRobotServer) -> float:
    """[m/s] of the tool, up and down apart."""
    velocity = arm.robot.tool_jacobian(arm.q) @ arm.qd
    return float(np.hypot(velocity[0], velocity[1]))


def test_a_second_goal_preempts_or_is_refused_as_set() -> None:
    with server(second="refuse") as arm:
        first = arm.send_goal(px.JointGoal(translation=REACHED))
        with pytest.raises(px.GoalRefusedError, match=f"goal {first} is being executed"):
            arm.send_goal(px.JointGoal(translation=REACHED))
        assert arm.result(first) is None
    with server() as arm:
        first = arm.send_goal(px.JointGoal(translation=REACHED))
        arm.step()
        second = arm.send_goal(px.JointGoal(translation=(2.5, 0.3, 1.5)))
        end = arm.result(first)
        assert end is not None
        assert (end.outcome, end.reason) == ("cancelled", f"preempted by goal {second}")
        assert arm.result(second) is None


def test_tasks_change_by_name_between_goals_only() -> None:
    with server() as arm:
        arm.set_tasks(["thesis"], off=["minimum_altitude"])
        assert arm.tasks == ("avoidance", "reach")
        with pytest.raises(px.ConfigError, match="off names reach, but the tasks are"):
            arm.set_tasks(["avoidance"], off=["reach"])
        arm.send_goal(px.JointGoal(translation=REACHED))
        with pytest.raises(px.ConfigError, match="goal 1 is being executed"):
            arm.set_tasks(["full"])


def test_an_arm_that_moves_keeps_to_its_accelerations_when_the_tasks_change() -> None:
    with server("joint_free", "finish.position=0.5", "finish.angle=2.0") as arm:
        number = arm.send_goal(px.JointGoal(translation=REACHED, init="jl"))
        assert arm.wait(number) is not None  # half a metre before the goal: it is still moving
        stands = [arm.q]
        for tick in range(4):
            arm.step()
            stands.append(arm.q)
            if tick == 1:
                arm.set_tasks(["thesis"])
        qd = np.diff(stands, axis=0) / arm.period
        assert np.abs(qd[1]).max() > 0.05
        change = np.abs(np.diff(qd, axis=0)).max(axis=0)
        assert np.all(change <= arm.robot.qdd_max * arm.period + 1e-9)


def test_a_stop_outlives_a_change_of_tasks_and_a_goal_that_waits_to_begin() -> None:
    with server() as arm:
        arm.send_goal(px.JointGoal(translation=REACHED))
        for _ in range(50):
            arm.step()
        waiting = arm.send_goal(px.JointGoal(translation=REACHED, init="jl"))
        # Its controller is told once that the joints are not numbers.
        arm._arm.ctrl.tick_known(0.51, np.full(12, np.nan), np.zeros((0, 3)), np.eye(4))
        for _ in range(200):
            arm.step()
        end = arm.result(waiting)
        assert end is not None
        assert end.outcome == "aborted"
        assert "the monitor stopped the arm" in end.reason
        with pytest.raises(px.ConfigError, match="the monitor has stopped the arm"):
            arm.set_tasks(["thesis"])
        with pytest.raises(px.GoalRefusedError, match="the monitor has stopped the arm"):
            arm.send_goal(px.JointGoal(translation=REACHED))
        assert arm.reset()
        arm.set_tasks(["thesis"])


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_goal_ends_when_the_thread_that_makes_the_ticks_fails() -> None:
    class Failing(px.JointRobotServer):  # type: ignore[misc, valid-type]
        def step(self, *, wait: bool = True) -> None:
            raise RuntimeError("no more")

    overrides = ["simulation.control_hz=100.0", "simulation.known_spacing=0.05"]
    with Failing("joint_free", overrides, robot=robot()) as arm:
        number = arm.send_goal(px.JointGoal(translation=REACHED))
        arm.start()
        deadline = clock.monotonic() + 60.0
        while arm.result(number) is None and clock.monotonic() < deadline:
            clock.sleep(0.01)
        end = arm.result(number)
        assert end is not None
        assert (end.outcome, end.reason) == ("aborted", "the server has failed: no more")
        with pytest.raises(px.GoalRefusedError, match="the server has failed: no more"):
            arm.send_goal(px.JointGoal(translation=REACHED))


def test_nobody_waits_for_a_goal_that_never_was() -> None:
    with server() as arm:
        arm.send_goal(px.JointGoal(translation=REACHED))
        before = arm.q
        assert arm.wait(99) is None
        np.testing.assert_array_equal(arm.q, before)


def test_goals_in_the_tools_frame_are_turned_with_it() -> None:
    """[JR] (4.6) forgets the rotation: r_ee + R_ee r_goal."""
    T_WE = np.eye(4)
    T_WE[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    T_WE[:3, 3] = 1, 2, 3
    quarter = px.JointGoal(translation=(0.5, 0, 0), rpy=(0, 0, math.pi / 2), frame="end_effector")
    T_WT = goal_pose(quarter, T_WE)
    np.testing.assert_allclose(T_WT[:3, 3], (1, 2.5, 3))
    np.testing.assert_allclose(T_WT[:3, 0], (-1, 0, 0), atol=1e-12)
    fixed = goal_pose(px.JointGoal(translation=(0.5, 0, 0), rpy=(0, 0, math.pi / 2)), T_WE)
    np.testing.assert_allclose(fixed[:3, 3], (0.5, 0, 0))
    np.testing.assert_allclose(fixed[:3, 0], (0, 1, 0), atol=1e-12)


def test_no_posture_reaches_beyond_the_reach() -> None:
    base_W, farthest = reach_of(robot())
    rng = np.random.default_rng(0)
    for q in rng.uniform(robot().q_min, robot().q_max, (500, 12)):
        assert np.linalg.norm(robot().tool_pose(q)[:3, 3] - base_W) <= farthest


class AnyInterleaving(RuleBasedStateMachine):
    """Goals, cancels and ticks in any order: one end each, and it never changes."""

    @initialize(second=st.sampled_from(["preempt", "refuse"]))
    def begin(self, second: str) -> None:
        overrides = ["simulation.control_hz=100.0", "finish.patience=1.0", "finish.progress=0.05"]
        self.arm = px.JointRobotServer("joint_free", overrides, robot=robot(), second=second)
        self.ended: list[int] = []
        end = self.arm._goals.end

        def counted(*arguments: object) -> None:
            self.ended.append(self.arm._goals.active.number)
            end(*arguments)

        self.arm._goals.end = counted
        self.taken: list[int] = []
        self.results: dict[int, object] = {}

    @rule(
        far=st.sampled_from([0.001, 0.02, 0.2, 5.0, math.nan]),
        init=st.sampled_from(["", "", "free", "jl", "mob_mob"]),
    )
    def send(self, far: float, init: str) -> None:
        goal = px.JointGoal(translation=(far, 0, 0), frame="end_effector", init=init)
        try:
            number = self.arm.send_goal(goal)
        except px.GoalRefusedError:
            return
        assert number not in self.taken
        self.taken.append(number)

    @rule(number=st.integers(0, 6))
    def cancel(self, number: int) -> None:
        ended = self.arm.result(number) is not None
        assert not (self.arm.cancel(number) and ended)

    @rule(ticks=st.sampled_from([1, 7, 60]))
    def step(self, ticks: int) -> None:
        for _ in range(ticks):
            self.arm.step()

    @precondition(lambda self: hasattr(self, "arm"))
    @invariant()
    def one_is_executed_and_the_others_have_ended_once(self) -> None:
        told = self.arm.feedback()
        running = set() if told is None else {told.goal}
        ended = self.ended
        assert len(set(ended)) == len(ended)
        assert set(ended) | running == set(self.taken)
        assert not set(ended) & running
        for number in ended:
            result = self.arm.result(number)
            assert result is not None
            assert self.results.setdefault(number, result) == result
        assert np.isfinite(self.arm.q).all()
        assert (self.arm.q >= robot().q_min - 1e-9).all()
        assert (self.arm.q <= robot().q_max + 1e-9).all()

    def teardown(self) -> None:
        if hasattr(self, "arm"):
            self.arm.close()
            assert sorted(self.ended) == self.taken


AnyInterleaving.TestCase.settings = settings(
    max_examples=40, stateful_step_count=16, deadline=None,
    suppress_health_check=list(HealthCheck),
)  # fmt: skip
TestAnyInterleaving = AnyInterleaving.TestCase

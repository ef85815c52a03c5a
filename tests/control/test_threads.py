"""One controller, one thread at a time."""

import threading

import numpy as np

import proxcgal as px

GOAL_OFFSET = 0.1  #: [m]


def hammer(calls: list, seconds_of_ticks: int) -> tuple[list[object], list[Exception]]:
    """Calls each in a thread of its own, again and again."""
    results: list[object] = []
    errors: list[Exception] = []

    def work(call) -> None:  # type: ignore[no-untyped-def]
        for i in range(seconds_of_ticks):
            try:
                results.append(call(i))
            except px.ProxError as error:
                errors.append(error)

    threads = [threading.Thread(target=work, args=(call,)) for call in calls]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return results, errors


def points(random: np.random.Generator, n: int = 20000) -> np.ndarray:
    return random.uniform(-1.5, 1.5, (n, 3))


def test_a_second_thread_gets_an_error_and_the_commands_stay_finite(ur10e: px.Robot) -> None:
    config = px.ControllerConfig(max_points=20000)
    ctrl = px.Controller(ur10e, px.Skin([]), config)
    q = np.array([0.0, -1.9, 2.8, -2.47, -1.57, 0.0])
    goal, cloud_W = ur10e.tool_pose(q), points(np.random.default_rng(1))

    def tick(i: int) -> np.ndarray:
        return ctrl.tick_known(0.01 * i, q, cloud_W, goal).qd

    results, errors = hammer(
        [tick, tick, lambda _i: ctrl.cloud_W(), lambda _i: ctrl.last_ticks(),
         lambda _i: ctrl.reset(), lambda _i: ctrl.retune([px.Avoidance(), px.Reach()])],
        60,
    )  # fmt: skip
    assert errors
    assert {str(error) for error in errors} == {
        "Controller is in use by another thread: one Controller, one thread at a time"
    }
    commands = [each for each in results if isinstance(each, np.ndarray) and each.ndim == 1]
    assert commands
    assert np.isfinite(commands).all()
    assert np.isfinite(ctrl.tick_known(10.0, q, cloud_W, goal).qd).all()


def test_two_controllers_in_two_threads_do_not_meet(ur10e: px.Robot) -> None:
    config = px.ControllerConfig(max_points=20000)
    q = np.array([0.0, -1.9, 2.8, -2.47, -1.57, 0.0])
    goal, cloud_W = ur10e.tool_pose(q), points(np.random.default_rng(2))
    both = [px.Controller(ur10e, px.Skin([]), config) for _ in range(2)]
    results, errors = hammer(
        [lambda i, c=each: c.tick_known(0.01 * i, q, cloud_W, goal).qd for each in both], 40
    )
    assert not errors
    assert len(results) == 80

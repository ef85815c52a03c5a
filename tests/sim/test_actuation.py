"""The arm's motion between two ticks."""

import numpy as np

from proxcgal.sim.actuation import Actuation


def test_an_arm_follows_each_command_for_one_period() -> None:
    arm = Actuation(np.array([0.1, -0.2]), period=0.01)
    arm.qd = np.array([1.0, 2.0])
    arm.step()
    np.testing.assert_allclose(arm.q, [0.11, -0.18])
    np.testing.assert_allclose(arm.within_step(0.004), [0.104, -0.192])
    arm.qd = np.zeros(2)
    arm.step()
    np.testing.assert_allclose(arm.q, [0.11, -0.18])


def test_an_arm_that_was_not_commanded_rests() -> None:
    arm = Actuation(np.array([0.1, -0.2]), period=0.01)
    np.testing.assert_array_equal(arm.within_step(0.005), arm.q)

"""Rotations against pinocchio's, and what each of them promises."""

import numpy as np
import pinocchio as pin
import pytest

from proxcgal.core import transforms
from proxcgal.core.typing import Array

VECTORS = np.random.default_rng(3).normal(size=(40, 3))
#: Axes, and their opposites, where a method that divides by a component must take another.
DIRECTIONS = np.concatenate([np.eye(3), -np.eye(3), VECTORS])
vectors = pytest.mark.parametrize("vector", VECTORS)
directions = pytest.mark.parametrize("direction", DIRECTIONS)


def unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


@vectors
def test_a_rotation_vector_is_the_exponential_of_its_cross_product(vector: Array) -> None:
    np.testing.assert_allclose(
        transforms.rotation_from_vector(vector), pin.exp3(vector), atol=1e-14
    )


@vectors
def test_roll_pitch_yaw_are_those_of_urdf(vector: Array) -> None:
    np.testing.assert_allclose(
        transforms.rotation_from_rpy(vector), pin.rpy.rpyToMatrix(vector), atol=1e-14
    )


@vectors
@pytest.mark.parametrize("of", [transforms.quaternion, transforms.nearest_quaternion])
def test_a_quaternion_is_that_of_its_rotation_up_to_sign(of: object, vector: Array) -> None:
    assert callable(of)
    R = pin.exp3(vector)
    expected = pin.Quaternion(R).coeffs()
    assert abs(float(of(R) @ expected)) == pytest.approx(1.0, abs=1e-14)


@directions
def test_axes_along_a_direction_are_right_handed(direction: Array) -> None:
    axes = transforms.axes_along(2.0 * direction, (0.0, 0.0, 1.0))
    np.testing.assert_allclose(axes[0], unit(direction), atol=1e-15)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_axes_along_nothing_are_along_the_other_direction() -> None:
    assert np.array_equal(transforms.axes_along(np.zeros(3), (0.0, 0.0, 1.0))[0], [0.0, 0.0, 1.0])


@directions
def test_the_least_rotation_brings_one_direction_to_another(direction: Array) -> None:
    start, end = unit(np.array([0.3, -0.2, 0.9])), unit(direction)
    R = transforms.least_rotation(start, end)
    np.testing.assert_allclose(R @ start, end, atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(pin.log3(R)), np.arccos(start @ end), atol=1e-7)


@directions
def test_least_rotations_of_z_are_least_rotations(direction: Array) -> None:
    if direction[2] > -1.0:  # at half a turn any axis across will do
        expected = transforms.least_rotation(np.array([0.0, 0.0, 1.0]), unit(direction))
        np.testing.assert_allclose(transforms.least_rotations_of_z(direction), expected, atol=1e-13)


@vectors
def test_the_sine_axis_between_is_that_of_the_rotation_between(vector: Array) -> None:
    here, there = pin.exp3(vector), pin.exp3(VECTORS[0])
    np.testing.assert_allclose(
        transforms.sine_axis_between(here, there), transforms.sine_axis(there @ here.T), atol=1e-14
    )


@vectors
def test_pose_errors_are_the_distance_and_the_angle(vector: Array) -> None:
    T, goal = transforms.pose(vector, vector), transforms.pose(VECTORS[0])
    distance, angle = transforms.pose_errors(T, goal)
    assert distance == pytest.approx(float(np.linalg.norm(vector - VECTORS[0])))
    assert angle == pytest.approx(float(np.linalg.norm(pin.log3(T[:3, :3]))), abs=1e-7)

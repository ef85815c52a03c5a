"""Against an independent lexicographic solver: what the first level wants it gets."""

import numpy as np
import pytest
import quadprog
from numpy.typing import NDArray

import proxcgal as px

Array = NDArray[np.float64]

STACKS = 10_000
LEAST_SINGULAR = 0.1  # of the first level's active rows: below, the damping acts
RIDGE = 1e-9  # makes the programs strictly convex


def random_stack(rng: np.random.Generator) -> list[px.Task]:
    """Two to five levels that mostly conflict; activations 0 or 1, rows of norm 0.1 to 10."""
    n = int(rng.integers(3, 13))
    while True:
        tasks = []
        for _ in range(int(rng.integers(2, 6))):
            m = int(rng.integers(1, min(n, 6) + 1))
            rows = rng.normal(size=(m, n))
            if tasks and rng.random() < 0.3:  # the same rows again, wanting something else
                rows[0] = tasks[0].jacobian[0]
            if m > 1 and rng.random() < 0.3:
                rows[-1] = rows[0] * rng.normal()
            rows *= 10.0 ** rng.uniform(-1, 1, (m, 1)) / np.linalg.norm(rows, axis=1, keepdims=True)
            activation = (rng.random(m) < 0.8).astype(float)
            tasks.append(px.Task(rows, rng.normal(size=m), activation))
        active = tasks[0].jacobian[tasks[0].activation > 0]
        # A row that repeats another leaves a singular value of rounding alone, which is none.
        singular = np.linalg.svd(active, compute_uv=False)
        if len(active) and singular[singular > 1e-9].min(initial=np.inf) >= LEAST_SINGULAR:
            return tasks


def lexicographic(tasks: list[px.Task]) -> Array:
    """(k,) squared residual of each level's active rows, the upper ones kept at theirs.

    A quadratic program a level: least |J qd - rate|^2, J qd of the levels above as they have it.
    """
    n = tasks[0].jacobian.shape[1]
    kept, values, residuals = np.zeros((0, n)), np.zeros(0), []
    for task in tasks:
        J = task.jacobian[task.activation > 0]
        rate = task.rate[task.activation > 0]
        basis, value = independent(kept, values)
        equations = (basis.T, value, len(basis)) if len(basis) else ()
        qd = quadprog.solve_qp(J.T @ J + RIDGE * np.eye(n), J.T @ rate, *equations)[0]
        residuals.append(float(np.sum((J @ qd - rate) ** 2)))
        kept, values = np.vstack([kept, J]), np.concatenate([values, J @ qd])
    return np.array(residuals)


def independent(rows: Array, values: Array) -> tuple[Array, Array]:
    """The same equations without those that follow from the others."""
    if not len(rows):
        return rows, values
    U, s, Vt = np.linalg.svd(rows, full_matrices=False)
    rank = int((s > 1e-8 * s[0]).sum())
    return Vt[:rank], (U[:, :rank].T @ values) / s[:rank]


def squared_residual(task: px.Task, qd: Array) -> float:
    active = task.activation > 0
    return float(np.sum((task.rate - task.jacobian @ qd)[active] ** 2))


def test_the_first_level_keeps_its_optimum_whatever_the_lower_ones_want() -> None:
    rng = np.random.default_rng(0)
    conflicts = 0
    for _ in range(STACKS):
        tasks = random_stack(rng)
        best = lexicographic(tasks[:1])[0]
        got = squared_residual(tasks[0], px.solve(tasks).qd)
        scale = 1.0 + float(tasks[0].rate @ tasks[0].rate)
        assert got == pytest.approx(best, abs=1e-5 * scale)
        alone = px.solve(tasks[1:]).qd
        conflicts += squared_residual(tasks[0], alone) > best + 1e-3
    assert conflicts > 0.9 * STACKS  # the stacks ask for it


def test_well_conditioned_stacks_are_lexicographic_in_every_level() -> None:
    """Where no level comes near the damping, all of them have the independent solver's residual."""
    rng = np.random.default_rng(1)
    done = 0
    while done < 300:
        n = int(rng.integers(6, 13))
        tasks = []
        for m in (2, 2, 1):
            tasks.append(px.Task(rng.normal(size=(m, n)), rng.normal(size=m), np.ones(m)))
        if np.linalg.svd(np.vstack([t.jacobian for t in tasks]), compute_uv=False).min() < 0.5:
            continue
        done += 1
        qd = px.solve(tasks).qd
        for task, best in zip(tasks, lexicographic(tasks), strict=True):
            assert squared_residual(task, qd) == pytest.approx(best, abs=1e-6)


def test_lower_levels_never_cost_the_first_its_residual_under_speed_limits() -> None:
    """Saturated, the first level has what it has alone."""
    rng = np.random.default_rng(2)
    for _ in range(500):
        tasks = random_stack(rng)
        n = tasks[0].jacobian.shape[1]
        limits = rng.uniform(0.05, 2.0, n)
        whole = px.solve(tasks, qd_max=limits)
        alone = px.solve(tasks[:1], qd_max=limits)
        assert (np.abs(whole.qd) <= limits + 1e-12).all()
        got, best = (squared_residual(tasks[0], s.qd) for s in (whole, alone))
        assert got <= best + 1e-5 * (1.0 + best)

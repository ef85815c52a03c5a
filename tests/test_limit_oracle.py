"""The limit stage against the same sequence of quadratic programmes in two other solvers."""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

proxsuite = pytest.importorskip("proxsuite")
quadprog = pytest.importorskip("quadprog")

ROOT = Path(__file__).parents[1]
D_STOP, RETREAT_SPEED = 0.05, 0.25
MOTION = 1e-4  # square root of the weight of |qd - nominal|^2 in (2a) and (2b)


def programmes_executable() -> Path:
    named = os.environ.get("PROXCGAL_LIMIT_PROGRAMMES")
    built = [Path(named)] if named else sorted(ROOT.glob("build/*/limit_programmes"))
    if not built:
        pytest.skip("limit_programmes is not built: cmake --build --preset dev")
    return built[0]


def by_proxsuite(H, g, C, low):
    """Solve min 1/2 x'Hx + g'x, C x >= low, by an augmented Lagrangian."""
    qp = proxsuite.proxqp.dense.QP(len(g), 0, len(low))
    qp.settings.eps_abs = 1e-10
    qp.settings.eps_rel = 0.0
    qp.settings.max_iter = 500
    qp.init(H, g, None, None, C, low, np.full(len(low), 1e20))
    qp.solve()
    return qp.results.x


def by_quadprog(H, g, C, low):
    """Solve the same by an active set."""
    return quadprog.solve_qp(H, -g, C.T, low)[0]


def solve(solver, H, g, C, low):
    """Return the point, and by how much it violates rows of unit norm."""
    norm = np.linalg.norm(C, axis=1)
    C, low = C[norm > 1e-12], low[norm > 1e-12]
    C, low = C / norm[norm > 1e-12, None], low / norm[norm > 1e-12]
    try:
        x = solver(H, g, C, low)
    except ValueError:  # quadprog: rows that agree but for rounding
        return np.zeros(len(g)), np.inf
    return x, float((low - C @ x).max(initial=0.0))


def wide(C, columns):
    """Append columns of zeros."""
    return np.hstack([C, np.zeros((len(C), columns))])


def read(line):
    """Take a line apart, as limit_programmes.cpp says."""
    v = np.array(line.split(), dtype=float)
    n, n_caps, n_rows = (int(x) for x in v[:3])
    at = 3

    def take(*shape):
        nonlocal at
        size = int(np.prod(shape))
        at += size
        return v[at - size : at].reshape(shape)

    low, high, nominal, brake = (take(n) for _ in range(4))
    W = take(n, n)
    caps, rows = take(n_caps, n + 1), take(n_rows, n + 4)
    stand, status = take(2)
    return low, high, nominal, brake, W, caps, rows, stand, int(status), take(n)


def sequence(solver, scale, low, high, nominal, brake, W, caps, rows, stand):
    """Levels (2a), (2b) and (3) one after the other; the answer, and how well each is solved."""
    n = len(low)
    N = caps[:, :n]
    hard = np.vstack([np.eye(n), -np.eye(n), N])
    b = np.concatenate([low, -high, np.minimum(-caps[:, n], N @ brake)])
    R = rows[:, :n]
    distance, d_min, gain, v_o = rows[:, n:].T
    beyond = np.maximum(0.0, distance - D_STOP)
    rate = np.minimum(
        np.maximum(0.0, v_o) + gain * (d_min - distance), RETREAT_SPEED + 20.0 * beyond
    )
    m = len(rate)
    error = 0.0
    near = np.clip(nominal, low, high)
    if m:
        # x = (scale (qd - near), slacks): of scale = MOTION the cost is |x|^2.
        weight = 0.25 / (0.25 + np.maximum(0.0, distance) / (0.5 + np.maximum(0.0, v_o)))
        z_hard, z_R = hard / scale, R / scale
        b_near, rate_near = b - hard @ near, rate - R @ near
        motion = np.full(n, (MOTION / scale) ** 2)
        C = np.vstack([wide(z_hard, 1), np.hstack([z_R, np.ones((m, 1))])])
        c = np.concatenate([b_near, rate_near - gain * beyond])
        x, e = solve(solver, np.diag(np.append(motion, 1.0)), np.zeros(n + 1), C, c)
        error, t = max(error, e), max(0.0, x[n])
        slacks = np.diag(1.0 / np.sqrt(weight))
        C = np.vstack([wide(z_hard, m), np.hstack([z_R, slacks]), wide(z_R, m)])
        c = np.concatenate([b_near, rate_near, rate_near - gain * beyond - t - 1e-11])
        H = np.diag(np.concatenate([motion, np.ones(m)]))
        x, e = solve(solver, H, np.zeros(n + m), C, c)
        error = max(error, e)
        hard = np.vstack([hard, R])
        b = np.concatenate([b, np.minimum(rate, R @ (near + x[:n] / scale) - 1e-11)])
    target = (1.0 - stand) * nominal
    x, e = solve(solver, W, -W @ target, hard, b)
    return x, max(error, e)


def programmes(count, seed):
    answer = subprocess.run(
        [programmes_executable(), str(count), str(seed)], capture_output=True, text=True, check=True
    )
    return [read(line) for line in answer.stdout.splitlines()]


def badly_scaled(i):
    return i // 3 % 4 == 1


@pytest.mark.parametrize("count", [1000, pytest.param(100_000, marks=pytest.mark.long)])
def test_limit_agrees_with_the_sequence_in_quadprog(count):
    differences = []
    for *programme, _, qd in programmes(count, 1):
        x, error = sequence(by_quadprog, MOTION, *programme)
        if error < 1e-9:
            differences.append(np.abs(x - qd).max())
    assert len(differences) > 0.98 * count
    # The rest are nearly singular: their answer moves by more than its rows' rounding.
    assert np.quantile(differences, 0.995) < 1e-6


@pytest.mark.parametrize("count", [24, pytest.param(2000, marks=pytest.mark.long)])
def test_limit_agrees_with_the_sequence_in_proxsuite(count):
    differences = []
    for i, (*programme, _, qd) in enumerate(programmes(count, 2)):
        if badly_scaled(i):  # beyond what it converges on
            continue
        x, error = sequence(by_proxsuite, 1.0, *programme)
        if error < 1e-8:
            differences.append(np.abs(x - qd).max())
    assert len(differences) > 0.9 * 0.75 * count
    assert np.quantile(differences, 0.9) < 1e-6

"""Two solvers of quadratic programmes: min 1/2 x'Hx - g'x with A x >= b.

Each returns nothing where it finds no point.
"""

import numpy as np
import proxsuite
import quadprog
from limit_programmes import Array


def unit_rows(A: Array, b: Array) -> tuple[Array, Array] | None:
    """The rows at unit norm; nothing where a row of zeros is violated."""
    norm = np.linalg.norm(A, axis=1)
    some = norm > 1e-12
    return None if np.any(b[~some] > 1e-12) else (A[some] / norm[some, None], b[some] / norm[some])


def by_quadprog(H: Array, g: Array, A: Array, b: Array) -> Array | None:
    """By an active set (Goldfarb and Idnani)."""
    unit = 1.0 / np.sqrt(np.diag(H))  # x = unit z: |qd - near|^2 counts as much as any slack
    rows = unit_rows(A * unit, b)
    try:
        if rows is None:
            return None
        return unit * quadprog.solve_qp(H * np.outer(unit, unit), unit * g, rows[0].T, rows[1])[0]
    except ValueError:  # the rows contradict one another
        return None


def by_proxsuite(H: Array, g: Array, A: Array, b: Array) -> Array | None:
    """By an augmented Lagrangian."""
    rows = unit_rows(A, b)
    if rows is None:
        return None
    dense = proxsuite.proxqp.dense
    # Its accuracy is absolute: without a factor |qd - near|^2 is lost in it, with too large a one
    # it does not converge.
    for cost in (1e4, 1e3) if H[0, 0] < 1e-6 else (1.0, 10.0):
        size, form, backend = len(rows[1]), dense.HessianType.Dense, dense.DenseBackend
        qp = dense.QP(len(g), 0, size, False, form, backend.PrimalDualLDLT)
        qp.settings.eps_abs, qp.settings.eps_rel, qp.settings.max_iter = 1e-10, 0.0, 60
        qp.init(cost * H, -cost * g, None, None, *rows, np.full(size, 1e20))
        qp.solve()
        if qp.results.info.status == proxsuite.proxqp.QPSolverOutput.PROXQP_SOLVED:
            return np.asarray(qp.results.x)
    return None

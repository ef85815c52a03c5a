"""The limit stage by its definition: (0), (1), (2a), (2b) and (3), with any quadratic solver.

Settings that are fields come from `px.LimitConfig`. The constants below are the stage's own, which
no field sets.
"""

from collections.abc import Callable, Sequence

import numpy as np
from limit_programmes import PERIOD, Array, Programme

# min 1/2 x'Hx - g'x with A x >= b, from H, g, A, b; nothing where it finds no point.
Solver = Callable[[Array, Array, Array, Array], Array | None]

MOTION = 1e-4  # square root of the weight of |qd - near|^2 in (2a) and (2b)
RISE = 20.0  # [1/s] of the bound on the rate of retreat, beyond d_stop
LEAVES_WITHIN = 0.04  # [m] beyond d_stop, over which a row leaves (2a)
CONTACT_TIME, CONTACT_SPEED = 0.25, 0.5  # [s] at which a weight is half; [m/s] assumed approach
ROUNDING = (1e-11, 1e-9, 1e-7)  # [m/s] by which what a level found gives way: the first that does


def held_for(p: Programme) -> float:
    """Longest time that a command may be held: 3 periods, or the interval times the margin."""
    return max(3 * PERIOD, p.config.period_margin * p.elapsed)


def viable(room: Array, a: Array, D: float) -> Array:
    """Velocity from which a joint that slows by a D after each D covers exactly `room`.

    From v = k a D it covers a D^2 (k + (k - 1) + ... + 1), and between two of these speeds the
    distance is linear in v.
    """
    k = np.arange(400.0)
    covered = k * (k + 1) / 2
    return np.array(
        [
            np.interp(r / (a_j * D**2), covered, k) * a_j * D
            for r, a_j in zip(np.maximum(room, 0.0), a, strict=True)
        ]
    )


def interval(p: Programme) -> tuple[Array, Array]:
    """(0) Velocity and viability of position, as far as the acceleration reaches."""
    D = held_for(p)
    reach = p.qdd_max * min(p.elapsed, D)
    low = -np.minimum(p.qd_max, viable(p.q + p.q_max, p.qdd_max, D))
    high = np.minimum(p.qd_max, viable(p.q_max - p.q, p.qdd_max, D))
    return (
        np.clip(low, p.qd_last - reach, p.qd_last + reach),
        np.clip(high, p.qd_last - reach, p.qd_last + reach),
    )


def braking(p: Programme, low: Array, high: Array) -> Array:
    """All joints straight to rest within the time that the slowest of them takes."""
    rest_after = np.max(np.abs(p.qd_last) / p.qdd_max)
    left = 1.0 - min(1.0, min(p.elapsed, held_for(p)) / rest_after)
    return np.clip(left * p.qd_last, low, high)


def approach(p: Programme) -> Array:
    """(1) c of each cap: the largest whose braking ends before d_stop, and is slow before `near`.

    Bisection on the distance that the arm closes: c T until it brakes, and from c to u with the
    deceleration c / (time until the joints rest), (c^2 - u^2) / (2 a).
    """
    config, D = p.config, held_for(p)
    window = min(p.elapsed, D)
    T = config.joint_state_age + D + config.dead_time + config.lag + config.scan_latency
    rest_after = np.max(np.abs(p.qd_last) / p.qdd_max) + window
    # An arm that follows with a lag, at rest until now, does not open a distance as commanded yet.
    follows = config.dead_time + config.lag
    late = follows * np.exp(-window / follows) if follows else 0.0
    distance = p.cap_distance - late * np.maximum(0.0, p.caps @ p.qd_last)
    slow = np.where(p.cap_near > 0, config.near_speed, np.inf)
    # With a lag it nears `near_speed` exponentially: two time constants more.
    to_near = distance - p.cap_near - 2 * config.lag * config.near_speed
    low, high = np.zeros(len(distance)), np.minimum(p.cap_speed, 20.0)
    for _ in range(50):
        c = (low + high) / 2
        stops = c * T + c * rest_after / 2 <= distance - config.d_stop
        to_slow = np.where(c > slow, c * T + (c - slow**2 / c) * rest_after / 2, -np.inf)
        kept = stops & (to_slow <= np.maximum(to_near, 0.0))
        low, high = np.where(kept, c, low), np.where(kept, high, c)
    return low


def rates(p: Programme) -> tuple[Array, Array, Array]:
    """(2) Rate, allowance in (2a) and weight of each retreat row."""
    approaching, beyond = np.maximum(0.0, p.obstacle_rate), p.distance - p.config.d_stop
    rate = np.minimum(
        approaching + p.gain * (p.d_min - p.distance),
        p.config.retreat_speed + RISE * np.maximum(0.0, beyond),
    )
    allowance = np.maximum(0.0, rate) * np.clip(beyond / LEAVES_WITHIN, 0.0, 1.0)
    contact = np.maximum(0.0, p.distance) / (CONTACT_SPEED + approaching)
    return rate, allowance, CONTACT_TIME / (CONTACT_TIME + contact)


def weights(p: Programme) -> Array:
    """W of (3): sum of w_k J_k' A_k J_k + eps I."""
    W = p.config.least_weight * np.eye(len(p.q))
    for k, (J, activation) in enumerate(p.tasks):
        w = max(p.config.level_ratio**k, p.config.least_weight)
        W += w * J.T @ (activation[:, None] * J)
    return W


def solve_sequence(
    p: Programme, stand: float, solver: Solver, rounding: Sequence[float] = ROUNDING
) -> Array | None:
    """(n,) velocity; nothing where the solver finds no point of a programme that has one."""
    low, high = interval(p)
    brake = braking(p, low, high)
    n, m = len(low), len(p.rows)
    A = np.vstack([np.eye(n), -np.eye(n), p.caps])
    # Where caps bind at the braking command they leave one point: rounding would contradict it.
    b = np.concatenate([low, -high, np.minimum(-approach(p), p.caps @ brake)]) - 1e-12
    rate, allowance, weight = rates(p)
    W = weights(p)
    near = np.clip(p.nominal, low, high)
    b_near, rate_near = b - A @ near, rate - p.rows @ near
    motion = np.full(n, MOTION**2)

    def least_violation(allowance: Array) -> float | None:
        # Of x = (qd - near, t): min t^2 + |motion (qd - near)|^2, rows qd + t >= rate - allowance.
        x = solver(
            np.diag(np.append(motion, 1.0)),
            np.zeros(n + 1),
            np.block([[A, np.zeros((len(A), 1))], [p.rows, np.ones((m, 1))]]),
            np.concatenate([b_near, rate_near - allowance]),
        )
        if x is None:
            return None
        return float(np.max(rate_near - allowance - p.rows @ x[:n], initial=0.0))

    # (3) with every retreat row fulfilled, where there is such a point: it would cost no more than
    # the motion to it.
    t = least_violation(np.zeros(m))
    if t is not None and t <= MOTION * np.linalg.norm(high - low):
        x = solver(W, W @ p.nominal, np.vstack([A, p.rows]), np.concatenate([b, rate]))
        if x is not None:
            return x
    # (2a)
    t = least_violation(allowance)
    if t is None or m == 0:
        return None
    most = allowance + t
    # (2b) of x = (qd - near, s): min sum w s^2 + ..., rows qd + s >= rate, s nowhere over `most`.
    H, g = np.diag(np.append(motion, weight)), np.zeros(n + m)
    rows = np.block(
        [[A, np.zeros((len(A), m))], [p.rows, np.eye(m)], [np.zeros((m, n)), -np.eye(m)]]
    )
    x = first_solved(
        lambda e: solver(H, g, rows, np.concatenate([b_near, rate_near, -most - e])), rounding
    )
    if x is None:
        return None
    # (3) with the rates that (2b) leaves.
    left = np.minimum(rate, p.rows @ (near + x[:n]))
    g, rows = W @ ((1.0 - stand) * p.nominal), np.vstack([A, p.rows])
    return first_solved(lambda e: solver(W, g, rows, np.concatenate([b, left - e])), rounding)


def first_solved(solve: Callable[[float], Array | None], rounding: Sequence[float]) -> Array | None:
    return next((x for e in rounding if (x := solve(e)) is not None), None)

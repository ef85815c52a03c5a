"""What the limit stage promises of every command, for any programme and any state."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from limit_programmes import PERIOD, SHAPES, draw
from limit_sequence import approach, braking, interval, rates

import proxcgal as px
from proxcgal import _core

JOINTS = 6
LATE = 5e-4  # [rad] past a limit


# Any programme of the comparison with other solvers.
programmes = st.builds(
    lambda seed, shape: draw(np.random.default_rng(seed), shape),
    st.integers(0, 2**32 - 1),
    st.sampled_from(SHAPES),
)


def joints(low: float, high: float) -> st.SearchStrategy[np.ndarray]:
    return arrays(np.float64, JOINTS, elements=st.floats(low, high))


@given(programmes)
def test_every_command_is_inside_the_interval_of_its_joints(p):
    out = p.by_stage()
    assert np.all(out.low <= out.qd)
    assert np.all(out.qd <= out.high)


@given(programmes)
def test_no_command_closes_a_distance_faster_than_its_cap_or_braking(p):
    out = p.by_stage()
    brake = braking(p, *interval(p))
    assert np.all(p.caps @ out.qd >= np.minimum(-approach(p), p.caps @ brake) - 1e-9)


@given(programmes, st.integers(0, 2**32 - 1))
def test_an_admissible_nominal_comes_back_bit_for_bit(p, seed):
    state = p.by_stage()
    nominal = np.clip(
        np.random.default_rng(seed).uniform(state.low, state.high), state.low, state.high
    )
    caps = p.caps @ nominal >= np.minimum(-approach(p), p.caps @ state.qd_brake) + 1e-9
    rows = p.rows @ nominal >= rates(p)[0] + 1e-9
    out = p.keep(nominal, caps, rows).by_stage()
    assert out.status == "unchanged"
    assert out.qd.tobytes() == nominal.tobytes()


@given(
    q=joints(-1e3, 1e3),
    qd_last=joints(-1e3, 1e3),
    elapsed=st.floats(-1.0, 1e3),
    nominal=joints(-1e6, 1e6),
    room=joints(0.0, 10.0),
    speed=joints(0.0, 10.0),
    acceleration=joints(1e-3, 1e3),
)
def test_every_state_leaves_each_joint_a_velocity(
    q, qd_last, elapsed, nominal, room, speed, acceleration
):
    limiter = _core.Limiter(-room, room, speed, acceleration, px.LimitConfig(), PERIOD)
    out = limiter.limit(q, qd_last, elapsed, nominal)
    assert np.all(out.low <= out.high)
    assert np.all((out.low <= out.qd) & (out.qd <= out.high))


@given(
    seed=st.integers(0, 2**32 - 1),
    longest=st.floats(0.1, 1.0),
    always=st.booleans(),
)
def test_no_late_tick_carries_a_joint_past_its_limit(seed, longest, always):
    # Intervals of up to 3 periods, the least `max_period`. One that is longer than the bound when
    # its command was made, or that makes the bound itself grow from tick to tick, is not promised.
    rng = np.random.default_rng(seed)
    q_max = rng.uniform(0.3, 1.0, JOINTS)
    limiter = _core.Limiter(
        -q_max,
        q_max,
        rng.uniform(0.5, 3.0, JOINTS),
        rng.uniform(2.0, 20.0, JOINTS),
        px.LimitConfig(),
        PERIOD,
    )
    q, qd, interval_s = rng.uniform(-0.9, 0.9, JOINTS) * q_max, np.zeros(JOINTS), PERIOD
    towards = rng.choice([-10.0, 10.0], JOINTS)
    for _ in range(150):
        qd = limiter.limit(q, qd, interval_s, towards).qd
        interval_s = 3 * PERIOD * longest * (1.0 if always else rng.uniform(0.05, 1.0))
        q = q + interval_s * qd
        assert np.all(np.abs(q) <= q_max + LATE)
        if rng.random() < 0.02:
            towards = -towards

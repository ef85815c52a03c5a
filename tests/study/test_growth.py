"""How times grow: exponents against known laws, intervals against an oracle."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from proxcgal.study.timing.grid import TimingCell, fit_growth, formula, growth, student_quantile


def made_cells(time: Callable[[float, float], float]) -> list[TimingCell]:
    return [
        TimingCell(
            robot="r", vertices=vertices, cloud=cloud, points=points, algorithm=2, method="fast",
            samples_us=np.array([time(vertices, points)]),
        )
        for vertices in (100, 300, 1000, 3000, 10000)
        for cloud, points in (("raw", 1600), ("2m", 600), ("1m", 200))
    ]  # fmt: skip


def test_growth_finds_the_exponents_of_a_power_law() -> None:
    (row,) = growth(made_cells(lambda v, n: 3.0 * v**0.4 * n**0.9))
    assert row["vertices"]["exponent"] == pytest.approx(0.4)
    assert row["points"]["exponent"] == pytest.approx(0.9)
    assert row["vertices"]["low"] == pytest.approx(0.4)


def test_times_by_the_papers_formula_grow_as_the_formula() -> None:
    (row,) = growth(made_cells(lambda v, n: 7.0 * formula(2, int(n), int(v))))
    for axis in ("vertices", "points"):
        assert row[axis]["exponent"] == pytest.approx(row[axis]["formula"])
    assert row["points"]["formula"] == pytest.approx(1.0, abs=0.01)
    assert 0.0 < row["vertices"]["formula"] < 0.2


def test_growth_with_what_does_not_vary_is_unknown() -> None:
    alone = [cell for cell in made_cells(lambda v, n: v * n) if cell.cloud == "raw"]
    (row,) = growth(alone)
    assert row["points"] is None
    assert row["vertices"]["exponent"] == pytest.approx(1.0)


@given(st.floats(-1.0, 2.0), st.integers(0, 100))
def test_the_interval_is_that_of_least_squares(exponent: float, seed: int) -> None:
    generator = np.random.default_rng(seed)
    x = np.geomspace(1.0, 100.0, 12)
    y = 5.0 * x**exponent * np.exp(0.1 * generator.standard_normal(12))
    fitted, oracle = fit_growth(x, y, ["one"] * 12), stats.linregress(np.log(x), np.log(y))
    assert fitted is not None
    assert fitted.low is not None
    assert fitted.exponent == pytest.approx(oracle.slope)
    half = oracle.stderr * stats.t.ppf(0.975, 10)
    assert fitted.exponent - fitted.low == pytest.approx(half, rel=0.01)


@pytest.mark.parametrize("freedom", [3, 4, 8, 30])
def test_students_quantile_is_within_a_percent(freedom: int) -> None:
    assert student_quantile(0.975, freedom) == pytest.approx(stats.t.ppf(0.975, freedom), rel=0.01)

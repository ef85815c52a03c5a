"""How a time grows: exponents fitted on log axes, with their intervals."""

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Growth:
    """Exponent of a power law, with the ends of its 95 % interval.

    The ends are None where there are too few values to tell.
    """

    exponent: float
    low: float | None
    high: float | None


def fit_growth(x: Sequence[float], y: Sequence[float], curve: Sequence[Hashable]) -> Growth | None:
    """Least squares of log y = a(curve) + b log x: one exponent b for several curves.

    Args:
        x: what y grows with, above 0.
        y: above 0.
        curve: which curve each value belongs to; each has a factor of its own.

    Returns:
        b, or None where x does not vary within any curve.
    """
    log_x, log_y = np.log(np.asarray(x, np.float64)), np.log(np.asarray(y, np.float64))
    curves = list(dict.fromkeys(curve))
    of = np.array([curves.index(name) for name in curve])
    for row in range(len(curves)):
        log_x[of == row] -= log_x[of == row].mean()
        log_y[of == row] -= log_y[of == row].mean()
    spread = float(log_x @ log_x)
    if spread < 1e-12:
        return None
    exponent = float(log_x @ log_y) / spread
    freedom = len(log_x) - len(curves) - 1
    if freedom < 3:
        return Growth(exponent, None, None)
    residual = log_y - exponent * log_x
    deviation = float(np.sqrt(residual @ residual / freedom / spread))
    half = student_quantile(0.5 + 0.5 * CONFIDENCE, freedom) * deviation
    return Growth(exponent, exponent - half, exponent + half)


def student_quantile(share: float, freedom: int) -> float:
    """Quantile of Student's t, within 1 % at the usual shares from 3 degrees of freedom on.

    Source: Abramowitz and Stegun, 26.7.5: Cornish and Fisher's expansion about the normal one.
    """
    z = NormalDist().inv_cdf(share)
    terms = (
        (z**3 + z) / 4.0,
        (5.0 * z**5 + 16.0 * z**3 + 3.0 * z) / 96.0,
        (3.0 * z**7 + 19.0 * z**5 + 17.0 * z**3 - 15.0 * z) / 384.0,
        (79.0 * z**9 + 776.0 * z**7 + 1482.0 * z**5 - 1920.0 * z**3 - 945.0 * z) / 92160.0,
    )
    return z + math.fsum(term / freedom**power for power, term in enumerate(terms, 1))

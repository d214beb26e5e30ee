"""Half-widths predicted before the measurement, against those of simulated regressions."""

import numpy as np
import pytest
import scipy.stats

from excite.information.half_widths import half_width_factor, residual_degrees_of_freedom
from excite.information.target import inverse_half

ROWS, COLUMNS, REPEATS = 40, 3, 4000


def _regressions() -> tuple[np.ndarray, np.ndarray]:
    """Factor of the covariance for noise 0.7, and half-widths of 99 % intervals of repeated least squares."""
    rng = np.random.default_rng(5)
    W = rng.normal(size=(ROWS, COLUMNS)) * [1.0, 20.0, 1e-3]
    noise = 0.7 * rng.normal(size=(ROWS, REPEATS))
    residual = noise - W @ np.linalg.lstsq(W, noise, rcond=None)[0]
    sigma = np.sqrt((residual**2).sum(0) / (ROWS - COLUMNS))
    t = scipy.stats.t.ppf(0.995, ROWS - COLUMNS)
    widths = t * sigma[:, None] * np.sqrt(np.diag(np.linalg.inv(W.T @ W)))
    return inverse_half(W / 0.7), widths


@pytest.mark.parametrize("probability", [0.5, 0.8, 0.95])
def test_half_widths_of_all_parameters_keep_to_the_prediction_with_its_probability(probability: float) -> None:
    factor, widths = _regressions()
    predicted = half_width_factor(ROWS - COLUMNS, probability=probability) * np.linalg.norm(factor, axis=1)
    share = np.mean(np.all(widths <= predicted, axis=1))
    assert abs(share - probability) < 4 * np.sqrt(probability * (1 - probability) / REPEATS)


def test_many_rows_leave_the_normal_quantile() -> None:
    assert half_width_factor(10**7) == pytest.approx(scipy.stats.norm.ppf(0.995), rel=1e-3)
    assert half_width_factor(10**7, level=0.95) == pytest.approx(1.96, rel=1e-3)


def test_few_rows_widen_both_quantile_and_scatter() -> None:
    factors = [half_width_factor(f) for f in (3, 10, 100, 1000)]
    assert factors == sorted(factors, reverse=True)
    assert residual_degrees_of_freedom(20, 13, 3) == 3
    assert residual_degrees_of_freedom(3013, 13, 3) == 250

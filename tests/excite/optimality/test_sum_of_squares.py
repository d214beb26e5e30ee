from __future__ import annotations

import numpy as np
import pytest

from excite.optimality.sum_of_squares import SumOfSquares, monomials

FREE, ONE = np.array([np.inf]), np.ones(1)


def entry(size: int, i: int, j: int) -> np.ndarray:
    M = np.zeros((size, size))
    M[i, j] += 0.5
    M[j, i] += 0.5
    return M


# m = (1, v, a, v v)
@pytest.mark.parametrize(
    ("Q", "linked", "highest", "largest"),
    [
        (entry(4, 1, 2), FREE, ONE, 1.0),  # v a
        (entry(4, 1, 2), FREE, ONE / 2, 0.5),
        (entry(4, 1, 1) + entry(4, 2, 2), FREE, ONE, 2.0),  # v^2 + a^2
        (entry(4, 1, 1) + entry(4, 2, 2), ONE, ONE, 1.0),  # with a^2 <= 1 - v^2
        (entry(4, 3, 3) - entry(4, 1, 1), FREE, ONE, 0.0),  # v^4 - v^2
        (entry(4, 1, 1) - entry(4, 3, 3), FREE, ONE, 0.25),  # v^2 - v^4
        (-entry(4, 0, 1), FREE, ONE, 0.0),  # -v, with v >= 0
    ],
)
def test_factor_is_the_largest_value(Q: np.ndarray, linked: np.ndarray, highest: np.ndarray, largest: float) -> None:
    factor = SumOfSquares(ONE, linked).factor(Q, entry(4, 0, 0), highest)
    assert factor == pytest.approx(largest, abs=1e-4)


def test_factor_bounds_what_is_sampled() -> None:
    rng = np.random.default_rng(0)
    signs, linked = np.array([1.0, -1.0]), np.array([1.5, np.inf])
    certificates = SumOfSquares(signs, linked)
    v, a = signs * rng.random((20000, 2)), rng.uniform(-1, 1, (20000, 2))
    v, a = (x[a[:, 0] ** 2 <= 1.5 * (1 - v[:, 0] ** 2)] for x in (v, a))
    m = monomials(v, a)
    for _ in range(5):
        Q, root = rng.standard_normal((8, 8)), rng.standard_normal((8, 8))
        Q, D = Q + Q.T, root @ root.T + np.eye(8)
        sampled = (np.einsum("ni,ij,nj->n", m, Q, m) / np.einsum("ni,ij,nj->n", m, D, m)).max()
        factor = certificates.factor(Q, D, np.ones(2))
        assert sampled <= factor <= sampled + 0.5 * abs(sampled) + 0.05

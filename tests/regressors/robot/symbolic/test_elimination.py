"""Elimination of sparse equations beside NumPy, and over boxes beside CasADi's own."""

from __future__ import annotations

import casadi as ca
import numpy as np

from regressors.robot.symbolic.elimination import eliminated
from regressors.robot.symbolic.intervals import interval_function


def equations(rng: np.random.Generator, m: int) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Symbols, and sparse equations of them that are regular."""
    x = ca.SX.sym("x", m)
    pattern = np.eye(m, dtype=bool)[rng.permutation(m)] | (rng.random((m, m)) < 0.25)
    A, size = ca.SX(m, m), rng.normal(size=(m, m)) + 3.0 * pattern
    for i, j in zip(*np.nonzero(pattern), strict=True):
        A[int(i), int(j)] = float(size[i, j]) * (1.0 + 0.1 * ca.sin(x[int(j)]))
    return x, A, ca.SX(ca.DM(rng.normal(size=(m, 2))))


def test_solutions_are_those_of_numpy_and_boxes_narrower_than_by_a_qr_factorisation() -> None:
    rng, narrower = np.random.default_rng(0), []
    for m in (1, 2, 5, 9, 12):
        x, A, B = equations(rng, m)
        both, points = ca.Function("both", [x], [ca.densify(ca.horzcat(A, B))]), rng.uniform(-3, 3, (20, m))
        values = np.array([np.array(both(point)) for point in points])
        if max(map(np.linalg.cond, values[:, :, :m])) > 1e3:
            continue
        found = eliminated(A, B, values)
        solution = ca.Function("solution", [x], [found])
        for point, numbers in zip(points, values, strict=True):
            expected = np.linalg.solve(numbers[:, :m], numbers[:, m:])
            np.testing.assert_allclose(np.array(solution(point)), expected, rtol=1e-9, atol=1e-9)
        ends = [[points.T - 1e-3], [points.T + 1e-3]]
        (low, high), (least, most) = (interval_function([x], ca.vec(each))(*ends) for each in (found, ca.solve(A, B)))
        here = ca.Function("here", [x], [ca.vec(found)])
        for k, point in enumerate(points):
            middle = np.array(here(point))[:, 0]
            assert np.all((low[:, k] <= middle) & (middle <= high[:, k]))
        narrower.append(np.max(high - low) <= 1.001 * np.max(most - least))
    assert len(narrower) >= 3
    assert all(narrower)

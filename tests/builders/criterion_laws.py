"""Information matrices at random, and laws that every criterion keeps, for tests of design criteria."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from written_files import saved

import excite
from excite.design.comparison import compare
from excite.design.design import Design
from excite.optimality.design_bound import bound
from excite.tasks.criteria import Criterion
from regressors.errors import InputError
from regressors.samples import Array


def regressor(seed: int, b: int = 5, rows: int = 30) -> Array:
    """W with columns of very different lengths, shape (rows, b)."""
    return np.asarray(np.random.default_rng(seed).normal(size=(rows, b)) * np.logspace(-1, 1, b))


def information_matrix(seed: int, b: int = 5, rows: int = 30) -> Array:
    """``M = W'W / N`` of such a regressor."""
    W = regressor(seed, b, rows)
    return np.asarray(W.T @ W / rows)


def slope(function: Callable[[float], float], h: float) -> float:
    """Derivative at zero by central differences of fourth order."""
    return (8 * (function(h) - function(-h)) - (function(2 * h) - function(-2 * h))) / (12 * h)


def check_gradient(criterion: Criterion, M: Array, seed: int, p: float, step: float = 2e-3) -> None:
    """The gradient against finite differences, along a direction that changes every eigenvalue by like parts."""
    A = np.random.default_rng(seed + 1).normal(size=M.shape)
    root = np.linalg.cholesky(M)
    direction = root @ ((A + A.T) / np.linalg.norm(A + A.T, 2)) @ root.T
    G = criterion.smooth(M, p)[1]
    np.testing.assert_allclose(G, G.T, atol=1e-10 * np.abs(G).max())
    expected = slope(lambda t: criterion.smooth(M + t * direction, p)[0], step / p)
    assert np.sum(G * direction) == pytest.approx(expected, rel=1e-6, abs=1e-7)


def check_design_pays(own: excite.Design, plain: excite.Design, folder: Path) -> Design:
    """A design for a goal is better by it than another one, is read back with it, and has no bound; the stored one."""
    of_own, of_plain = compare([own, plain])
    assert of_own.goal == pytest.approx(own.minimised_value, rel=1e-9)
    assert of_plain.goal is not None
    assert of_own.goal < of_plain.goal
    stored = excite.load_design(saved(folder, own))
    assert stored.task.objective == own.task.objective
    with pytest.raises(InputError, match="no bound is known"):
        bound(stored)
    return stored

"""Failures of numerical libraries become one error with its likely cause; everything else passes as it is."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
import scipy.linalg
import scipy.sparse.linalg

from regressors.errors import ExciteError, InputError, NumericalError
from regressors.numerical import numerical_work


def of_casadi() -> None:
    ca.inv(ca.DM([[0.0, 0.0], [0.0, 0.0]]) * ca.DM.nan(2, 2))
    x = ca.SX.sym("x")
    ca.rootfinder("f", "newton", {"x": x, "g": x * x + 1})(0.0)


def of_arpack() -> None:
    scipy.sparse.linalg.eigsh(np.diag(np.arange(1.0, 50.0)), k=2, maxiter=1, tol=1e-30)


FAILURES: dict[str, Callable[[], object]] = {
    "singular": lambda: np.linalg.inv(np.zeros((2, 2))),
    "not positive definite": lambda: np.linalg.cholesky(-np.eye(2)),
    "nan in linear algebra": lambda: scipy.linalg.svd(np.full((2, 2), np.nan)),
    "overflow": lambda: np.array([1e308]) * 10,
    "invalid": lambda: np.array([np.inf]) - np.inf,
    "division": lambda: np.array([1.0]) / 0.0,
    "overflow of Python": lambda: 10.0**400,
    "nan to a whole number": lambda: int(float("nan")),
    "no convergence": of_arpack,
    "casadi": of_casadi,
}


@pytest.mark.parametrize("what", FAILURES)
def test_a_numerical_failure_names_its_likely_cause(what: str) -> None:
    message = r"^the work failed numerically \(.+\); check `period`$"
    with pytest.raises(NumericalError, match=message) as failed, numerical_work("the work", "check `period`"):
        FAILURES[what]()
    assert isinstance(failed.value, ExciteError)
    assert failed.value.__cause__ is not None
    assert "\n" not in str(failed.value)


@pytest.mark.parametrize("error", [InputError("wrong"), KeyError("x"), ValueError("no such"), RuntimeError("a bug")])
def test_other_errors_pass(error: Exception) -> None:
    with pytest.raises(type(error)) as passed, numerical_work("the work", "check it"):
        raise error
    assert passed.value is error


def test_an_inner_seam_speaks() -> None:
    @numerical_work("the outer work", "check it")
    def outer() -> None:
        with numerical_work("the inner work", "check it"):
            np.linalg.inv(np.zeros((2, 2)))

    for _ in range(2):  # a decorated function can be called again
        with pytest.raises(NumericalError, match="the inner work failed"):
            outer()


def test_what_is_harmless_says_so_itself() -> None:
    with numerical_work("the work", "check it"), np.errstate(divide="ignore"):
        assert np.isinf(np.array([1.0]) / 0.0).all()

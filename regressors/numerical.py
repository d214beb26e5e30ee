"""Which columns of a matrix are independent, and failures inside numerical libraries as one error of the project."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from threadpoolctl import threadpool_limits

from regressors.errors import ExciteError, NumericalError
from regressors.samples import Array, Index

DESCRIPTION_CAUSE = (
    "lengths, masses or inertias of very different sizes are the likely cause: check the description of the robot"
)
_NOT_FINITE = re.compile(
    r"infs? or nans?|nan to integer|not finite|non-finite|out of range float|infinit|overflow", re.I
)
_FOREIGN = re.compile(r"casadi|\.[ch]pp:|scipy|no progress|singular|converge", re.I)


@contextmanager
def numerical_work(what: str, cause: str) -> Iterator[None]:
    """Turn what linear algebra, special functions and optimisers raise in the block into `NumericalError`.

    An overflow, a division by zero or an invalid operation of NumPy in the block is such a failure too; where one is
    harmless, the code around it says so with ``np.errstate``.
    """
    try:
        with np.errstate(over="raise", invalid="raise", divide="raise"):
            yield
    except ExciteError:
        raise
    except (ArithmeticError, RuntimeWarning, RuntimeError, ValueError) as error:
        if not _is_numerical(error):
            raise
        reason = " ".join(str(error).split()) or type(error).__name__
        reason = reason if len(reason) <= 80 else f"{reason[:77]}..."
        raise NumericalError(f"{what} failed numerically ({reason}); {cause}") from error


@contextmanager
def one_thread() -> Iterator[None]:
    """Linear algebra in one thread, since on matrices as small as ours more threads only wait for each other."""
    import scipy.linalg  # noqa: F401  brings a library of its own, which a limit that is set before does not reach

    with threadpool_limits(1):
        yield


def null_space(A: Array) -> Array:
    """Orthonormal solutions of ``A x = 0``, whose rows are independent, without importing `scipy.linalg` for it."""
    return np.ascontiguousarray(np.linalg.svd(A)[2][len(A) :].T)


def _is_numerical(error: Exception) -> bool:
    """Whether it is a library's word for numbers that it cannot work with."""
    text = str(error)
    if isinstance(error, np.linalg.LinAlgError | ArithmeticError | RuntimeWarning):
        return True
    if isinstance(error, ValueError):
        return bool(_NOT_FINITE.search(text))
    return type(error).__module__.startswith("scipy") or (type(error) is RuntimeError and bool(_FOREIGN.search(text)))


def or_none(value: float) -> float | None:
    """A number as JSON can hold it; None if it is not finite."""
    return float(value) if np.isfinite(value) else None


TOLERANCE = 1e-8
ROUNDING = 1e-4
_TIE = 1e-6
_EXACT = 1e-6  # of a coefficient, or a tenth of what rounding leaves of a column


def column_lengths(W: Array) -> Array:
    """Length of each column; 1 of those that are zero, so that it divides them."""
    length = np.linalg.norm(W, axis=0)
    return np.asarray(np.where(length > 0, length, 1.0))


def independent_columns(R: Array, tolerance: float = TOLERANCE, sizes: Array | None = None) -> Index:
    """Columns that do not depend on the ones to their left (left-to-right QR) [Gautier 1991]."""
    # R (k, p); sizes (p,)
    Q = np.zeros((R.shape[0], min(R.shape)))
    chosen: list[int] = []
    smallest = 1e-12 * float(np.linalg.norm(R, axis=0).max(initial=0.0))
    sizes = np.linalg.norm(R, axis=0) if sizes is None else sizes
    for j in range(R.shape[1]):
        column, size = R[:, j].copy(), float(sizes[j])
        for _ in range(2):  # a second projection removes what rounding left of the first
            column -= Q @ (Q.T @ column)
        rest = float(np.linalg.norm(column))
        if rest > tolerance * size and rest > smallest and len(chosen) < Q.shape[1]:
            Q[:, len(chosen)] = column / rest
            chosen.append(j)
    return np.asarray(chosen, dtype=np.intp)


def explained_columns(R: Array, kept: Index, sizes: Array) -> Array:
    """Columns by the kept ones to their left, ``R ~ R[:, kept] A``, without rounding's part, shape (b, p)."""
    # R (k, p); kept (b,); sizes (p,)
    A = np.zeros((len(kept), R.shape[1]))
    A[np.arange(len(kept)), kept] = 1.0
    length = np.linalg.norm(R[:, kept], axis=0)
    scale = np.where(sizes > 0.0, sizes, np.inf)
    for j in sorted(set(range(R.shape[1])) - set(kept.tolist())):
        left = int(np.searchsorted(kept, j))
        A[:left, j] = np.linalg.lstsq(R[:, kept[:left]], R[:, j], rcond=None)[0]
    residual = np.linalg.norm(R - R[:, kept] @ A, axis=0) / scale
    small = max(10.0 * float(residual.max(initial=0.0)), _EXACT)
    A = np.where(np.abs(A) * length[:, None] / scale < small, 0.0, A)
    nearest = np.round(A)
    return np.where(np.abs(A - nearest) < _EXACT, nearest, A)


def pivoted_columns(R: Array, tolerance: float = TOLERANCE) -> Index:
    """Columns in the order of column-pivoted QR: each time the one with the largest remainder after projection.

    Equal remainders are common, since links share lengths; the leftmost is taken, whatever the rounding.
    """  # R (k, p)
    rest = R.copy()
    chosen: list[int] = []
    first = 0.0
    for _ in range(min(R.shape)):
        sizes = np.linalg.norm(rest, axis=0)
        sizes[chosen] = 0.0
        largest = float(sizes.max(initial=0.0))
        first = first or largest
        if largest <= tolerance * first:
            break
        chosen.append(int(np.argmax(sizes >= (1.0 - _TIE) * largest)))
        direction = rest[:, chosen[-1]] / np.linalg.norm(rest[:, chosen[-1]])
        for _ in range(2):  # the second projection removes what rounding left of the first
            rest = rest - np.outer(direction, direction @ rest)
    return np.asarray(chosen, dtype=np.intp)

"""The seam at which failures inside numerical libraries become one error of the project, with their likely cause."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from regressors.errors import ExciteError, NumericalError

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
    except (np.linalg.LinAlgError, ArithmeticError, RuntimeWarning) as error:
        raise _turned(what, cause, error) from error
    except (RuntimeError, ValueError) as error:
        if not _is_numerical(error):
            raise
        raise _turned(what, cause, error) from error


def _is_numerical(error: Exception) -> bool:
    """Whether it is a library's word for numbers that it cannot work with."""
    text = str(error)
    if isinstance(error, ValueError):
        return bool(_NOT_FINITE.search(text))
    return type(error).__module__.startswith("scipy") or (type(error) is RuntimeError and bool(_FOREIGN.search(text)))


def _turned(what: str, cause: str, error: Exception) -> NumericalError:
    reason = " ".join(str(error).split()) or type(error).__name__
    reason = reason if len(reason) <= 80 else f"{reason[:77]}..."
    return NumericalError(f"{what} failed numerically ({reason}); {cause}")

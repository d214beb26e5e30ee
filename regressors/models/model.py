"""The one interface of every model: which parameters it has, and how motion shows them.

A model is linear in its parameters, ``y = W parameters``. Design and identification see nothing else of it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
import scipy.sparse

from regressors.models.columns import Column
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples
from regressors.symbolic.vectorised import LaneFunction

_CHUNK = 4096


@dataclass(frozen=True, eq=False)
class Combination:
    """How the values of a model's expression at some instants make the rows of W.

    The expression's rows are r states over r densities; row w of W, for each of the r equations, is
    ``difference[w] @ state + integral[w] @ density``. A model of single instants has no densities, and no integral.

    Parameters
    ----------
    time : ndarray, shape (T,)
        Instants at which the expression is evaluated [s].
    difference : sparse array, shape (N, T)
    integral : sparse array, shape (N, T), or None
    unit : float
        Rows of `RegressorModel.assemble` are these times so much: the length of a window where these are means.
    """

    time: Array
    difference: scipy.sparse.csr_array
    integral: scipy.sparse.csr_array | None = None
    unit: float = 1.0


class RegressorModel(ABC):
    """A linear-in-parameters model of a robot.

    Attributes
    ----------
    robot : Robot
    columns : tuple of Column
        Parameters, in the order of the regressor's columns.
    row_labels : tuple of (str, str)
        Name and unit of each of the r scalar equations.
    """

    robot: Robot
    columns: tuple[Column, ...]
    row_labels: tuple[tuple[str, str], ...]

    @abstractmethod
    def rows(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        """Regressor of one instant as an expression.

        Parameters
        ----------
        q, dq, ddq : SX, shape (n, 1)
            Joint position, velocity, acceleration [rad, rad/s, rad/s^2, or with m].

        Returns
        -------
        SX, shape (r, p)
            One row per scalar equation, one column per parameter; for a model over time windows its rate of change.
        """

    def expression(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        """What is evaluated at each instant and then combined into rows of W: here the rows themselves."""
        return self.rows(q, dq, ddq)

    def definition(self) -> tuple[Array, tuple[str, ...]]:
        """What the parameters are made of: ``parameters = matrix @ standard``, and the standard parameters' names."""
        return np.eye(len(self.columns)), self.names

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(column.name for column in self.columns)

    @cached_property
    def function(self) -> LaneFunction:
        """`rows` compiled for many instants at once."""
        return self._compiled(self.rows)

    def _compiled(self, expression: Callable[[ca.SX, ca.SX, ca.SX], ca.SX]) -> LaneFunction:
        symbols = [ca.SX.sym(name, self.robot.n) for name in ("q", "dq", "ddq")]
        return LaneFunction(symbols, expression(*symbols))

    def instants(self, samples: Samples) -> Array:
        """Rows of single instants, whatever the model makes of them over time.

        Parameters
        ----------
        samples : Samples
            N instants, not necessarily of one motion.

        Returns
        -------
        ndarray, shape (N * r, p)
            The r rows of the first instant, then of the second, and so on.
        """
        return evaluated(self.function, samples).reshape(-1, len(self.columns))

    def assemble(self, samples: Samples) -> Array:
        """Stacked regressor W of a motion.

        Parameters
        ----------
        samples : Samples
            N instants of one motion.

        Returns
        -------
        ndarray, shape (N * r, p)
        """
        return self.instants(samples)

    def right_side(self, samples: Samples, measured: Array) -> Array:
        """Left-hand side y of ``y = W parameters`` from what was measured.

        Parameters
        ----------
        samples : Samples
        measured : ndarray, shape (N, r)
            Joint torques [Nm or N].

        Returns
        -------
        ndarray, shape (N * r,)
        """
        return np.asarray(measured, dtype=float).reshape(-1)

    def combination(self, duration: float, count: int) -> Combination:
        """Instants and weights that represent W of a periodic motion for an optimiser.

        Parameters
        ----------
        duration : float
            [s]
        count : int
            About how many rows per equation.
        """
        time = np.linspace(0.0, duration, count, endpoint=False)
        return Combination(time, scipy.sparse.eye_array(count, format="csr"))

    def times(self, duration: float, rate: float) -> Array:
        """Instants at which a motion of some duration is to be sampled for `assemble`.

        Parameters
        ----------
        duration : float
            [s]
        rate : float
            At least so many per second [Hz].
        """
        return np.linspace(0.0, duration, round(duration * rate) + 1)


def evaluated(function: LaneFunction, samples: Samples) -> Array:
    """Values of a matrix expression at every sample, shape (N, rows, columns)."""
    values = np.zeros((samples.time.size, *function.shape))
    for start in range(0, samples.time.size, _CHUNK):
        part = slice(start, start + _CHUNK)
        motion = [np.ascontiguousarray(x[part].T) for x in (samples.q, samples.dq, samples.ddq)]
        values[part, function.row, function.column] = function(*motion).T
    return values

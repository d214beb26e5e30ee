"""The one interface of every model: which parameters it has, and how motion shows them.

A model is an expression of one instant's motion, ``rows(q, dq, ddq)``, linear in its parameters:
``y = rows(q, dq, ddq) @ parameters``. Design and identification see nothing else of it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property

import casadi as ca
import numpy as np

from regressors.columns import Column
from regressors.lanes import LaneFunction
from regressors.robot import Robot
from regressors.samples import Array, Samples

_CHUNK = 4096


class RegressorModel(ABC):
    """A linear-in-parameters model of a robot.

    Attributes
    ----------
    robot : Robot
    columns : tuple of Column
        Parameters, in the order of the regressor's columns.
    row_labels : tuple of (str, str)
        Name and unit of each row of one instant.
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
            One row per scalar equation, one column per parameter.
        """

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
        q, dq, ddq = (ca.SX.sym(name, self.robot.n) for name in ("q", "dq", "ddq"))
        return LaneFunction([q, dq, ddq], self.rows(q, dq, ddq))

    def assemble(self, samples: Samples) -> Array:
        """Stacked regressor W of a motion.

        Parameters
        ----------
        samples : Samples
            N instants.

        Returns
        -------
        ndarray, shape (N * r, p)
            The r rows of the first instant, then of the second, and so on.
        """
        r, p = len(self.row_labels), len(self.columns)
        W = np.zeros((samples.time.size, r, p))
        for start in range(0, samples.time.size, _CHUNK):
            part = slice(start, start + _CHUNK)
            motion = [np.ascontiguousarray(x[part].T) for x in (samples.q, samples.dq, samples.ddq)]
            W[part, self.function.row, self.function.column] = self.function(*motion).T
        return W.reshape(-1, p)

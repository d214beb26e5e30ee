"""Rows of the regressor at single states, in the columns of the design's convention."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from excite.design.formulation import Formulation
from excite.information.target import model_of
from regressors.errors import InputError
from regressors.models.model import RegressorModel
from regressors.models.partial import PartialMotion
from regressors.samples import Array, Index, Samples


@dataclass(frozen=True, eq=False)
class StateRows:
    """``M = mean of F(s) + P`` with ``F = Y'Y``: Y the rows of one state, divided by their noise, times T."""

    model: RegressorModel  # of single instants, with exact friction
    motion: PartialMotion  # from the k moving coordinates to the joints
    index: Index  # (b,) base columns
    transform: Array  # (b, b) T
    noise: Array  # (r,)
    prior: Array  # (b, b) P, per instant, in the columns of the convention

    def __call__(self, S: Array) -> Array:
        """Y at every state, shape (N, r, b)."""  # S (N, 3 k)
        y, dy, ddy = np.split(S, 3, axis=1)
        N, offset = self.motion.matrix.T, self.motion.offset
        q, dq, ddq = y @ N + offset, dy @ N, ddy @ N
        samples = Samples(np.arange(float(len(S))), q, dq, ddq, np.zeros_like(q))
        W = self.model.instants(samples)[:, self.index] @ self.transform
        return W.reshape(len(S), self.noise.size, -1) / self.noise[:, None]

    def expression(self, y: ca.SX, dy: ca.SX, ddy: ca.SX) -> ca.SX:
        """Y as an expression of the moving coordinates, shape (r, b)."""
        N, offset = ca.DM(self.motion.matrix), ca.DM(self.motion.offset)
        Y = self.model.expression(ca.mtimes(N, y) + offset, ca.mtimes(N, dy), ca.mtimes(N, ddy))
        weighted = ca.mtimes(ca.DM(np.diag(1.0 / self.noise)), Y[:, self.index.tolist()])
        return ca.mtimes(weighted, ca.DM(self.transform))

    def positions_that_count(self) -> NDArray[np.bool_]:
        """Coordinates whose position enters Y at all, shape (k,): not joint 1 of an arm with a vertical first axis."""
        symbols = [ca.SX.sym(name, self.motion.matrix.shape[1]) for name in ("y", "dy", "ddy")]
        Y = ca.vec(ca.cse(self.expression(*symbols)))
        return np.asarray(ca.which_depends(Y, symbols[0], 1, False), dtype=bool)


def state_rows(formulation: Formulation) -> StateRows:
    """Rows at single states of a design problem."""
    blueprint, task = formulation.blueprint, formulation.task
    model = model_of(formulation.target.robot, task).restricted(blueprint.motion, task.model.equations)
    if model.window is not None or not _is_instantaneous(model):
        raise InputError(
            f"{type(model).__name__} integrates over time windows: its information matrix is no mean over states, and "
            "no bound on it is known; give a design of a model of single instants, such as `differential`"
        )
    instants = model.times(task.trajectory.period, task.output.rate).size
    T = blueprint.transform
    return StateRows(
        model, blueprint.motion, blueprint.index, T, blueprint.noise, T.T @ blueprint.precision @ T / instants
    )


def _is_instantaneous(model: RegressorModel) -> bool:
    return type(model).assemble is RegressorModel.assemble

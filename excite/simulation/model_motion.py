"""Equations of motion of an identified model: ``M = d(Y beta) / d ddq``, and ``Y beta`` at ``ddq = 0``.

Friction that grows with the load depends on ddq too; it follows drive by drive from the torque that is left.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from excite.simulation.load_shares import carried_along_motion, load_shares
from excite.simulation.plant import solved
from regressors.errors import InputError
from regressors.friction.curves import FrictionCurves, carried_along, smooth_direction
from regressors.models.base import Base
from regressors.models.carried_torque import RIGID
from regressors.models.columns import LOAD_SHARE
from regressors.models.model import RegressorModel
from regressors.samples import Array


class ModelMotion:
    """Rate of the state (q, dq) of a model's moving coordinates, ``q = N s + q0``, under joint torques."""

    def __init__(self, model: RegressorModel, beta: Array, base: Base, friction: FrictionCurves | None) -> None:
        equations = model.torque_equations()
        if equations is None:
            raise InputError(f"a motion can be replayed with a model of joint torques, not with {type(model).__name__}")
        if np.shape(beta) != (base.rank,) or not np.all(np.isfinite(beta)):
            raise InputError(f"replay: expected {base.rank} finite base parameters, given {np.asarray(beta).tolist()}")
        if equations.unused:
            raise InputError(
                f"replay: the equations of {', '.join(equations.unused)} are not used, "
                "so their motion is not determined"
            )
        self.N, self.q0 = equations.motion.matrix, equations.motion.offset
        self.robot, self._whole, self._friction = model.robot, equations.model, friction
        columns, beta = [base.columns[k] for k in base.index], np.asarray(beta, dtype=float)
        self._index = base.index.tolist()
        self._beta = ca.DM(np.where([c.kind == LOAD_SHARE for c in columns], 0.0, beta))
        self._rigid = ca.DM(np.where([c.group in RIGID for c in columns], beta, 0.0))
        self._shares = load_shares(model, base, beta)

    @property
    def k(self) -> int:
        """Number of moving coordinates."""
        return int(self.N.shape[1])

    def to_moving(self, q: Array, offset: bool) -> Array:
        """Moving coordinates of joint positions, or of velocities, along the last axis."""
        return np.asarray((q - self.q0 * offset) @ np.linalg.pinv(self.N).T)

    def of(self, x: ca.SX, tau: ca.SX, width: float) -> tuple[ca.SX, ca.SX]:
        """Rate of the state under the moving coordinates' torques, and the smallest pivot of M."""
        k, N = self.k, ca.DM(self.N)
        s, ds, dds = x[:k], x[k:], ca.SX.sym("dds", k)
        q, dq, ddq = ca.mtimes(N, s) + ca.DM(self.q0), ca.mtimes(N, ds), ca.mtimes(N, dds)
        soft = self._whole.softened(width)
        W = ca.mtimes(N.T, soft.rows(q, dq, ddq)[:, self._index])
        M = ca.jacobian(ca.mtimes(W, self._beta), dds)
        bias, rigid = (ca.substitute(ca.mtimes(W, beta), dds, ca.SX.zeros(k, 1)) for beta in (self._beta, self._rigid))
        moved = self._carried(dq, tau, width) - bias
        if self._shares:
            moved = carried_along_motion(self.robot, self._shares, self.N, dq, moved + rigid, width) - rigid
        acceleration, least = solved(M, moved)
        return ca.vertcat(ds, acceleration), least

    def _carried(self, dq: ca.SX, tau: ca.SX, width: float) -> ca.SX:
        """Torques of the moving coordinates without the known friction."""
        if self._friction is None:
            return tau
        direction, N = smooth_direction(self.robot, dq, width), ca.DM(self.N)
        if not self._friction.loaded:
            return tau - ca.mtimes(N.T, self._friction.joint_expression(self.robot, dq, direction))
        joints = ca.mtimes(ca.DM(carried_along(self.robot, self.N)), tau)
        return ca.mtimes(N.T, self._friction.carried_expression(self.robot, dq, joints, direction))

    def function(self, width: float) -> ca.Function:
        """Map (state, torques) to (rate, smallest pivot)."""
        x, tau = ca.SX.sym("x", 2 * self.k), ca.SX.sym("tau", self.k)
        return ca.Function("rate", [x, tau], ca.cse([*self.of(x, tau, width)]))

    def fastest(self, x: Array, width: float) -> float:
        """Largest eigenvalue magnitude of the motion at some states (N, 2k), moving and at rest [1/s]."""
        state, tau = ca.SX.sym("x", 2 * self.k), ca.SX.sym("tau", self.k)
        rate, _ = self.of(state, tau, width)
        jacobian = ca.Function("jacobian", [state, tau], [ca.densify(ca.jacobian(rate, state))])
        still = x * np.repeat([1.0, 0.0], self.k)
        points = np.vstack([x, still])
        blocks = np.array(jacobian.map(len(points))(points.T, np.zeros((self.k, len(points)))))
        blocks = blocks.reshape(2 * self.k, len(points), 2 * self.k).transpose(1, 0, 2)
        finite = blocks[np.all(np.isfinite(blocks), axis=(1, 2))]
        return float(np.abs(np.linalg.eigvals(finite)).max(initial=0.0)) if finite.size else 0.0

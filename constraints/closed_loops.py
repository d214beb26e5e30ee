"""Limits of robots with closed loops: of joints that follow others, and of the distance from singular configurations.

Dependent joints are functions of the independent ones that are known by their derivatives only. Their limits, as those
of torques, are enclosed between instants by bounds of the third derivatives of all joints, which `largest_jerks` proves.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

from constraints.linear import LinearConstraint, linear_limits
from constraints.nonlinear import NonlinearConstraint
from regressors.models.partial import ClosedMotion
from regressors.robot.robot import Robot
from regressors.robot.symbolic.intervals import OverBoxes, interval_function
from regressors.robot.symbolic.kinematics import sparse
from regressors.robot.symbolic.loops import CLOSED, Loops, closure_residual, loops_of
from regressors.samples import Array, Samples

SINGULAR = 0.01  # of the reference's det(J_d' J_d): where it is less, a configuration is as good as singular
_JERK = 3  # derivative


def free_limits(robot: Robot) -> tuple[LinearConstraint, ...]:
    """Those of `constraints.linear.linear_limits` that are linear in the joints that move on their own."""
    if not robot.closures:
        return linear_limits(robot)
    dependent = list(loops_of(robot).dependent)
    parts = (limit.rows(~limit.matrix[:, dependent].any(axis=1)) for limit in linear_limits(robot))
    return tuple(part for part in parts if part.labels)


def dependent_limits(robot: Robot) -> tuple[LinearConstraint, ...]:
    """The others of them, but for jerks, which no function of position, velocity and acceleration is."""
    if not robot.closures:
        return ()
    dependent = list(loops_of(robot).dependent)
    parts = (limit.rows(limit.matrix[:, dependent].any(axis=1)) for limit in linear_limits(robot))
    return tuple(part for part in parts if part.labels and part.derivative < _JERK)


def loop_limits(robot: Robot) -> tuple[NonlinearConstraint, ...]:
    """Limits of dependent joints, and the distance from singular configurations; none without closed loops."""
    if not robot.closures:
        return ()
    return (_regular(loops_of(robot)), *(_nonlinear(limit, robot.n) for limit in dependent_limits(robot)))


def loops_closed(robot: Robot) -> tuple[NonlinearConstraint, ...]:
    """What keeps a search where the loops close at all; of a motion that is certified nothing is left to ask."""
    if not robot.closures:
        return ()

    def open_by(q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        return ca.sumsqr(closure_residual(robot, q)) / _OPEN**2

    one, label = np.ones(1), " and ".join(closure.label for closure in robot.closures)
    return (NonlinearConstraint(robot.n, open_by, -np.inf * one, one, one, (label,), ("1",), quantity="loops"),)


_OPEN = 1e3 * CLOSED


def _regular(loops: Loops) -> NonlinearConstraint:
    """``det(J_d' J_d)`` as part of that in the reference, which must not fall to zero."""

    def determinant(q: ca.SX) -> ca.SX:
        x = ca.SX.sym("x", loops.robot.n)
        J_d = ca.jacobian(closure_residual(loops.robot, x), x)[:, list(loops.dependent)]
        pivots, *_ = ca.ldl(ca.densify(ca.mtimes(J_d.T, J_d)))
        return ca.substitute(_product(pivots), x, q)

    q = ca.SX.sym("q", loops.robot.n)
    usual = float(ca.Function("usual", [q], [determinant(q)])(loops.reference))
    names = [loops.robot.joint_names[k] for k in loops.dependent]
    label = f"{', '.join(loops.names)} determines {', '.join(names)}"
    one = np.ones(1)
    return NonlinearConstraint(
        loops.robot.n, lambda q, dq, ddq: determinant(q) / usual, SINGULAR * one, np.inf * one, one, (label,), ("1",),
        quantity="loops",
    )  # fmt: skip


def _product(values: ca.SX) -> ca.SX:
    product = ca.SX(1.0)
    for k in range(values.numel()):
        product *= values[k]
    return product


def _nonlinear(limit: LinearConstraint, joints: int) -> NonlinearConstraint:
    """The same limit for a certificate that encloses it."""
    matrix, offset, order = sparse(limit.matrix), ca.DM(limit.offset), limit.derivative

    def expression(*motion: ca.SX) -> ca.SX:
        return ca.mtimes(matrix, motion[order]) + offset

    half = 0.5 * (limit.upper - limit.lower)
    scale = np.where(np.isfinite(half), half, 1.0)
    bounds = limit.lower, limit.upper, scale
    return NonlinearConstraint(joints, expression, *bounds, limit.labels, limit.units, quantity=limit.quantity)


_PARTS = (1024, 4096, 16384)
_MORE = 1.5  # times the way at the speed in the middle: a box that is tried
_LEAST = 1e-9  # rad or m: what boxes are wider
_CONTRACTS = 0.5  # norm of P J_d - E in a box in which J_d is proven regular


def largest_jerks(
    motion: ClosedMotion, samples: Callable[[Array], Samples], duration: float, jerk: Array
) -> Array:
    """Bounds of every joint's |jerk| that hold at every instant, shape (n,); infinite where J_d may be singular.

    Around instants q_d is enclosed by boxes that it cannot leave: if ``|dq_d| <= V`` as long as q is in a box, and
    ``V h`` less than its half width, then it is there for the time h [Moore 1966, Picard]. There, with P the
    pseudo-inverse of J_d in the middle and ``|P J_d - E| <= D``, ``J x = b`` bounds ``|x_d| <= (E - D)^-1 |P (b - J_i
    x_i)|``, first velocities, then accelerations and jerks, from what differentiating ``g(q) = 0`` leaves as b. Each
    box has the middles of the next ones in it, so that all belong to one continuous motion.
    """  # samples of all joints; jerk (k,) of the independent ones
    bounds = _Bounds(motion.loops)
    for parts in _PARTS:
        h = duration / parts  # twice what is needed, so that neighbours overlap
        found = bounds.over(samples((np.arange(parts) + 0.5) * h), h, jerk)
        if found is not None:
            whole = np.zeros(motion.loops.robot.n)
            whole[list(motion.loops.independent)], whole[list(motion.loops.dependent)] = jerk, found
            return whole
    return np.full(motion.loops.robot.n, np.inf)


class _Bounds:
    """What the closures' derivatives say of dependent joints over boxes."""

    def __init__(self, loops: Loops) -> None:
        n = loops.robot.n
        q, dq, ddq = (ca.SX.sym(name, n) for name in ("q", "dq", "ddq"))
        g = closure_residual(loops.robot, q)
        J = ca.jacobian(g, q)
        self.loops, self.rows = loops, g.numel()
        self.i, self.d = list(loops.independent), list(loops.dependent)
        first = ca.mtimes(J, dq)
        second = ca.jtimes(first, ca.vertcat(q, dq), ca.vertcat(dq, ddq))
        third = ca.jtimes(second, ca.vertcat(q, dq, ddq), ca.vertcat(dq, ddq, ca.SX.zeros(n, 1)))
        self._J = interval_function([q], ca.vec(J))
        self._rest: tuple[OverBoxes, OverBoxes] = (
            interval_function([q, dq], ca.substitute(second, ddq, ca.SX.zeros(n, 1))),
            interval_function([q, dq, ddq], third),
        )

    def over(self, samples: Samples, h: float, jerk: Array) -> Array | None:
        """Largest jerks of dependent joints within h of instants of a closed motion; None where nothing is proven."""
        count, i, d = samples.time.size, self.i, self.d
        q, dq, ddq = samples.q, samples.dq, samples.ddq
        second = np.abs(ddq[:, i]) + jerk * h  # (N, k)
        first = np.abs(dq[:, i]) + second * h
        width = np.zeros_like(q)
        width[:, i] = first * h
        width[:, d] = _MORE * np.abs(dq[:, d]) * h + _LEAST
        for _ in range(_TRIES):
            low, high = (q - width).T, (q + width).T
            J_low, J_high = (x.reshape(-1, self.rows, count).transpose(2, 1, 0) for x in self._J([low], [high]))
            J, off = (J_high + J_low) / 2, (J_high - J_low) / 2
            if not np.all(np.isfinite(off)):
                return None
            P = np.linalg.pinv(J[:, :, d])
            size = np.abs(P)
            D = np.abs(P @ J[:, :, d] - np.eye(len(d))) + size @ off[:, :, d]
            if not np.all(D.sum(axis=2) < _CONTRACTS):
                return None
            of_free = np.abs(P @ J[:, :, i]) + size @ off[:, :, i]
            speed = _solved(D, np.einsum("tdk,tk->td", of_free, first))
            if np.all(speed * h <= width[:, d]):
                break
            width[:, d] = _MORE * speed * h + _LEAST
        else:
            return None
        if np.any(np.abs(np.diff(q[:, d], axis=0)) > np.minimum(width[1:, d], width[:-1, d])):
            return None
        whole = np.zeros((2, *q.shape))
        whole[0][:, i], whole[0][:, d] = first, speed
        second_rest, third_rest = self._rest
        left = [-whole[0].T, whole[0].T]
        b = _product_bound(P, second_rest([low, left[0]], [high, left[1]]))
        acceleration = _solved(D, b + np.einsum("tdk,tk->td", of_free, second))
        whole[1][:, i], whole[1][:, d] = second, acceleration
        ends = [[low, -whole[0].T, -whole[1].T], [high, whole[0].T, whole[1].T]]
        b = _product_bound(P, third_rest(*ends))
        third = _solved(D, b + of_free @ jerk)
        return np.asarray(third.max(axis=0)) if np.all(np.isfinite(third)) else None


_TRIES = 4


def _solved(D: Array, b: Array) -> Array:
    """``(E - D)^-1 b`` for D and b that are not negative, shape (N, m)."""
    return np.asarray(np.linalg.solve(np.eye(D.shape[1]) - D, b[:, :, None])[:, :, 0])


def _product_bound(P: Array, ends: tuple[Array, Array]) -> Array:
    """Largest ``|P b|`` for b between ends, shape (N, m)."""
    low, high = (x.T for x in ends)
    middle, off = (low + high) / 2, (high - low) / 2
    return np.asarray(np.abs(np.einsum("tdr,tr->td", P, middle)) + np.einsum("tdr,tr->td", np.abs(P), off))

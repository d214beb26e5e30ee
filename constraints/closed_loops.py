"""Limits of robots with closed loops: of joints that follow others, and of the distance from singular configurations.

Dependent joints are functions of the independent ones that are known by their derivatives only. Their limits, as those
of torques, are enclosed between instants by bounds of the third derivatives of all joints, which `LoopProof` has.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from operator import mul

import casadi as ca
import numpy as np

from constraints.certificate import ENCLOSED, LimitUse
from constraints.linear import LinearConstraint, Selection, linear_limits
from constraints.nonlinear import NonlinearConstraint
from regressors.models.partial import ClosedMotion
from regressors.robot.robot import Robot
from regressors.robot.symbolic.intervals import interval_function
from regressors.robot.symbolic.kinematics import sparse
from regressors.robot.symbolic.loops import CLOSED, SINGULAR, Loops, closure_residual, loops_of
from regressors.samples import Array, Samples

_JERK = 3  # derivative


def free_limits(robot: Robot) -> tuple[LinearConstraint, ...]:
    """Those of `constraints.linear.linear_limits` that are linear in the joints that move on their own."""
    if not robot.closures:
        return linear_limits(robot)
    parts = (limit.rows(~_follow(limit, robot)) for limit in linear_limits(robot))
    return tuple(part for part in parts if part.labels)


def dependent_limits(robot: Robot) -> tuple[LinearConstraint, ...]:
    """The others of them, but for jerks, which no function of position, velocity and acceleration is."""
    if not robot.closures:
        return ()
    parts = (limit.rows(_follow(limit, robot)) for limit in linear_limits(robot))
    return tuple(part for part in parts if part.labels and part.derivative < _JERK)


def _follow(limit: LinearConstraint, robot: Robot) -> Selection:
    """Which functions depend on dependent joints."""
    return np.asarray(limit.matrix[:, loops_of(robot).dependent].any(axis=1))


def loop_limits(robot: Robot) -> tuple[NonlinearConstraint, ...]:
    """The same as functions that are enclosed between instants."""
    return tuple(_nonlinear(limit, robot.n) for limit in dependent_limits(robot))


def _nonlinear(limit: LinearConstraint, joints: int) -> NonlinearConstraint:
    matrix, offset, order = sparse(limit.matrix), ca.DM(limit.offset), limit.derivative

    def expression(*motion: ca.SX) -> ca.SX:
        return ca.mtimes(matrix, motion[order]) + offset

    half = 0.5 * (limit.upper - limit.lower)
    bounds = limit.lower, limit.upper, np.where(np.isfinite(half), half, 1.0)
    return NonlinearConstraint(joints, expression, *bounds, limit.labels, limit.units, quantity=limit.quantity)


def closing_limits(robot: Robot) -> tuple[NonlinearConstraint, ...]:
    """What keeps a search where the loops close, and away from where they are singular; see `LoopProof` for the rest.

    How far they are open, and ``det(J_d' J_d)`` as part of that in the reference.
    """
    if not robot.closures:
        return ()
    loops, q = loops_of(robot), ca.SX.sym("q", robot.n)
    g = closure_residual(robot, q)
    J_d = ca.jacobian(g, q)[:, list(loops.dependent)]
    pivots, *_ = ca.ldl(ca.densify(ca.mtimes(J_d.T, J_d)))
    both = ca.Function("both", [q], [ca.sumsqr(g) / _OPEN**2, reduce(mul, ca.vertsplit(pivots))])
    usual = both(loops.reference)[1]

    def expression(q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        gap, determinant = both.call([q], True, False)
        return ca.vertcat(gap, determinant / usual)

    none, labels = np.inf, tuple(f"{what} {_names(loops)}" for what in ("loops of", "singular loops of"))
    lower, upper, scale = np.array([[-none, 1.0, 1.0], [_SINGULAR, none, 1.0]]).T
    return (NonlinearConstraint(robot.n, expression, lower, upper, scale, labels, ("1", "1"), quantity="loops"),)


def _names(loops: Loops) -> str:
    return ", ".join(loops.robot.joint_names[k] for k in loops.dependent)


_OPEN = 1e3 * CLOSED
_SINGULAR = 0.01  # of the reference's det(J_d' J_d)
_PARTS = (1024, 4096, 16384)
_MORE = 1.2  # times the way at the speed in the middle: a box that is tried
_LEAST = 1e-9  # rad or m: what boxes are wider
_LOOSE = 4.0  # times the jerks that occur: what finer boxes are to improve
_CONTRACTS = 0.5  # norm of P J_d - E in a box in which J_d is proven regular


@dataclass(frozen=True, eq=False)
class LoopProof:
    """What is proven of a motion of closed loops for every instant, not only those at which it is looked at.

    Around instants q_d is enclosed by boxes that it cannot leave: if ``|dq_d| <= V`` as long as q is in a box, and
    ``V h`` less than its half width, then it is there for the time h [Moore 1966]. There, with P the pseudo-inverse of
    J_d in the middle and ``|P J_d - E| <= D``, J_d has no singular value less than ``1 - |D|`` times its least one in
    the middle. ``J x = b`` bounds ``|x_d| <= (E - D)^-1 |P (b - J_i x_i)|``: what velocities and accelerations differ
    from those in the middle, then jerks, with what differentiating ``g(q) = 0`` leaves as b. Each box has the middles
    of the next ones in it, so that all belong to one continuous motion.
    """

    jerk: Array  # (n,) bounds of every joint's |jerk|; infinite where nothing is proven
    regular: float  # bound of the least singular value of J_d, over the largest near by; 0 where nothing is proven
    time: float  # about when it is reached [s]
    loops: Loops

    @classmethod
    def of(cls, motion: ClosedMotion, samples: Callable[[Array], Samples], duration: float, jerk: Array) -> LoopProof:
        """That of a motion with given samples of all joints, and largest jerks of the independent ones, shape (k,)."""
        loops, best = motion.loops, None
        bounds = _Bounds(loops)
        for parts in _PARTS:
            h = duration / parts  # twice what is needed, so that neighbours overlap
            middles = samples(np.linspace(h / 2, duration - h / 2, parts))
            best = bounds.over(middles, h, jerk) or best
            if best is not None and np.all(best[0] <= _LOOSE * np.abs(middles.dddq).max(axis=0)[bounds.d]):
                break
        if best is None:
            return cls.none(loops)
        whole = np.zeros(loops.robot.n)
        whole[bounds.i], whole[bounds.d] = jerk, best[0]
        return cls(whole, best[1], best[2], loops)

    @classmethod
    def none(cls, loops: Loops) -> LoopProof:
        """Nothing."""
        return cls(np.full(loops.robot.n, np.inf), 0.0, 0.0, loops)

    @property
    def use(self) -> LimitUse:
        """Certificate of the distance from singular configurations."""
        label = f"distance from singular configurations of {_names(self.loops)}"
        margin, use = self.regular - SINGULAR, SINGULAR / max(self.regular, SINGULAR**2)
        return LimitUse(label, "1", self.regular, self.time, SINGULAR, margin, use, ENCLOSED, "loops")


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
        self._second = interval_function([q, dq], ca.substitute(second, ddq, ca.SX.zeros(n, 1)))
        self._third = interval_function([q, dq, ddq], third)

    def over(self, samples: Samples, h: float, jerk: Array) -> tuple[Array, float, float] | None:
        """Largest jerks of dependent joints within h of instants of a closed motion; None where nothing is proven.

        With them the least ratio of singular values of J_d, and when.
        """
        count, i, d = samples.time.size, self.i, self.d
        q, dq, ddq = samples.q, samples.dq, samples.ddq
        off_q, off_dq, off_ddq = np.zeros((3, *q.shape))  # how far they get from the middle
        off_ddq[:, i] = jerk * h
        off_dq[:, i] = (np.abs(ddq) * h)[:, i] + off_ddq[:, i] * h / 2
        off_q[:, i] = (np.abs(dq) * h)[:, i] + off_dq[:, i] * h
        off_q[:, d] = _MORE * np.abs(dq[:, d]) * h + _LEAST
        for _ in range(_TRIES):
            low, high = (q - off_q).T, (q + off_q).T
            J_low, J_high = (x.reshape(-1, self.rows, count).transpose(2, 1, 0) for x in self._J([low], [high]))
            J, off = (J_high + J_low) / 2, (J_high - J_low) / 2
            if not np.all(np.isfinite(off)):
                return None
            P: Array = np.asarray(np.linalg.pinv(J[:, :, d]), dtype=float)
            D = np.abs(P @ J[:, :, d] - np.eye(len(d))) + np.abs(P) @ off[:, :, d]
            if not np.all(D.sum(axis=2) < _CONTRACTS):
                return None
            of_free = np.abs(P @ J[:, :, i]) + np.abs(P) @ off[:, :, i]
            # ``J_d (dq_d - dq_d(m)) = -J dq(m) - J_i (dq_i - dq_i(m))``, and so for accelerations
            left = _size(P, np.einsum("trn,tn->tr", J, dq), np.einsum("trn,tn->tr", off, np.abs(dq)))
            off_dq[:, d] = _solved(D, left + np.einsum("tdk,tk->td", of_free, off_dq[:, i]))
            way = (np.abs(dq) + off_dq)[:, d] * h
            if np.all(way <= off_q[:, d]):
                break
            off_q[:, d] = _MORE * way + _LEAST
        else:
            return None
        if np.any(np.abs(np.diff(q[:, d], axis=0)) > np.minimum(off_q[1:, d], off_q[:-1, d])):
            return None
        speeds = (dq - off_dq).T, (dq + off_dq).T
        second, wide = _middle(self._second([low, speeds[0]], [high, speeds[1]]))
        second, wide = second + np.einsum("trn,tn->tr", J, ddq), wide + np.einsum("trn,tn->tr", off, np.abs(ddq))
        off_ddq[:, d] = _solved(D, _size(P, second, wide) + np.einsum("tdk,tk->td", of_free, off_ddq[:, i]))
        faster = (ddq - off_ddq).T, (ddq + off_ddq).T
        third = _middle(self._third([low, speeds[0], faster[0]], [high, speeds[1], faster[1]]))
        bound = _solved(D, _size(P, *third) + of_free @ jerk)
        if not np.all(np.isfinite(bound)):
            return None
        sigma = np.linalg.svd(J[:, :, d], compute_uv=False)
        norm = np.sqrt(D.sum(axis=1).max(axis=1) * D.sum(axis=2).max(axis=1))
        ratio = (1.0 - norm) * sigma[:, -1] / sigma[:, 0]
        worst = int(ratio.argmin())
        return bound.max(axis=0), float(ratio[worst]), float(samples.time[worst])


_TRIES = 4


def _solved(D: Array, b: Array) -> Array:
    """``(E - D)^-1 b`` for D and b that are not negative, shape (N, m)."""
    return np.asarray(np.linalg.solve(np.eye(D.shape[1]) - D, b[:, :, None])[:, :, 0])


def _middle(ends: tuple[Array, Array]) -> tuple[Array, Array]:
    """Middles and half widths, shape (N, r)."""
    low, high = (x.T for x in ends)
    return (low + high) / 2, (high - low) / 2


def _size(P: Array, middle: Array, off: Array) -> Array:
    """Largest ``|P b|`` for b around a middle, shape (N, m)."""
    return np.asarray(np.abs(np.einsum("tdr,tr->td", P, middle)) + np.einsum("tdr,tr->td", np.abs(P), off))

"""Motion of a robot with closed loops: its dependent joints from the independent ones.

The closures hold where ``g(q) = 0``, with the Jacobian ``J = dg/dq = [J_d J_i]``. In a planar loop some of its rows
follow from others, so that the dependent joints move as ``dq_d = -(J_d' J_d)^-1 J_d' J_i dq_i``, which is
``-J_d^-1 J_i dq_i`` where J_d is square. Positions are found by Newton's method, accelerations and jerks by
differentiating the velocities along the motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache

import casadi as ca
import numpy as np
import scipy

from regressors.errors import InputError, listed_names
from regressors.robot.closures import MimicJoint
from regressors.robot.robot import BASE, Robot
from regressors.robot.symbolic.elimination import eliminated
from regressors.robot.symbolic.kinematics import bodies, sparse
from regressors.robot.symbolic.vectorised import VectorisedFunction
from regressors.samples import Array, Index, Samples

CLOSED = 1e-9  # what may be left open [m, or the sine of an angle]
_RANK = 1e-8  # of the largest singular value
SINGULAR = 1e-3  # ratio of singular values of J_d below which the independent joints hardly determine the others
_STEP, _STEPS = 0.3, 30  # largest Newton step [rad or m], and how many there may be
_CONVERGED, _DAMPING = 1e-13, 1e-13  # step that is none [rad or m]; part of the trace of J_d' J_d that is added to it
_NEAR = 0.1  # of the reference's root of det(J_d' J_d), below which a path passes a singular configuration
_PATH = 0.1  # between two configurations that are solved one after the other [rad or m]
_TURN = 2 * np.pi
_ANCHORS, _PIVOTS = 2000, 200  # configurations from which others are solved, and for which pivots are chosen


def closure_residual(robot: Robot, q: ca.SX) -> ca.SX:
    """What the closures leave open, ``g(q)``: distances of points, sines of angles between axes, or of mimic joints."""
    # q (n, 1)
    still = ca.SX(robot.n, 1)
    poses = {BASE: (ca.SX.eye(3), ca.SX(3, 1))}
    for body, motion in zip(robot.bodies, bodies(robot, q, still, still), strict=True):
        poses[body.name] = motion.rotation, motion.origin
    rows = []
    for closure in robot.closures:
        if isinstance(closure, MimicJoint):
            follower, leader = (q[robot.joint_index(name)] for name in closure.joints)
            rows.append(follower - closure.multiplier * leader - closure.offset)
            continue
        (R1, p1), (R2, p2) = (poses[name] for name in closure.bodies)
        first, second = (sparse(point) for point in closure.points)
        rows.append(p2 + ca.mtimes(R2, second) - p1 - ca.mtimes(R1, first))
        if closure.axes is not None:
            E = ca.mtimes([R1.T, R2, sparse(closure.axes).T])
            rows.append(ca.inv_skew(E - E.T) / 2)
    return ca.vertcat(*rows)


@dataclass(frozen=True, eq=False)
class Loops:
    """The loops of a robot, with joints by which all others are determined."""

    robot: Robot
    reference: Array  # (n,) a configuration in which all loops are closed, nearest to home [rad or m]
    independent: tuple[int, ...]
    dependent: tuple[int, ...]

    def __getstate__(self) -> dict[str, object]:
        """Return the state without compiled functions, which are rebuilt when needed."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the independent joints."""
        return tuple(self.robot.joint_names[k] for k in self.independent)

    @property
    def driven(self) -> tuple[int, ...]:
        """Joints that drives act on."""
        return tuple(k for k, name in enumerate(self.robot.joint_names) if name not in self.robot.passive)

    @property
    def redundant(self) -> bool:
        """Whether drives act on more joints than the loops leave free."""
        return len(self.driven) > len(self.independent)

    def directions(self, q: ca.SX) -> ca.SX:
        """``N(q)`` of ``dq = N dq_i``, shape (n, k)."""  # q (n, 1)
        J_d, J_i = self._split_jacobian(q)
        N = ca.SX(self.robot.n, len(self.independent))
        N[list(self.independent), :] = ca.SX.eye(len(self.independent))
        N[list(self.dependent), :] = -ca.solve(ca.mtimes(J_d.T, J_d), ca.mtimes(J_d.T, J_i))
        return N

    @cached_property
    def _rates(self) -> VectorisedFunction:
        """Velocities, accelerations and jerks of all joints as columns, shape (n, 3)."""
        q, (v, a, j) = ca.SX.sym("q", self.robot.n), (ca.SX.sym(name, len(self.independent)) for name in "vaj")
        dq = ca.mtimes(self.directions(q), v)
        ddq = ca.jtimes(dq, ca.vertcat(q, v), ca.vertcat(dq, a))
        dddq = ca.jtimes(ddq, ca.vertcat(q, v, a), ca.vertcat(dq, a, j))
        return VectorisedFunction([q, v, a, j], ca.horzcat(dq, ddq, dddq))

    @cached_property
    def _constraint(self) -> VectorisedFunction:
        return _constraint(self.robot)

    def rates(self, samples: Samples) -> Samples:
        """Closed configurations with the rates that those of the independent joints give all others."""
        given = (x[:, self.independent] for x in (samples.dq, samples.ddq, samples.dddq))
        values = dense(self._rates, samples.q, *given)
        return Samples(samples.time, samples.q, *(np.ascontiguousarray(values[:, :, k]) for k in range(3)))

    @cached_property
    def _velocities(self) -> VectorisedFunction:
        """Velocities and accelerations of all joints as columns, shape (n, 2)."""
        q, (v, a) = ca.SX.sym("q", self.robot.n), (ca.SX.sym(name, len(self.independent)) for name in "va")
        dq = ca.mtimes(self.directions(q), v)
        ddq = ca.jtimes(dq, ca.vertcat(q, v), ca.vertcat(dq, a))
        return VectorisedFunction([q, v, a], ca.horzcat(dq, ddq))

    @cached_property
    def _projected(self) -> VectorisedFunction:
        """``N' u`` of a vector u of all joints."""
        q, u = ca.SX.sym("q", self.robot.n), ca.SX.sym("u", self.robot.n)
        return VectorisedFunction([q, u], ca.densify(ca.mtimes(self.directions(q).T, u)))

    def moved(self, motion: Sequence[Array]) -> list[Array]:
        """Positions, velocities and accelerations of all joints, (n, N), from those of the independent ones, (k, N).

        Where the loops do not close, dependent joints are those of the reference, which leaves the loops open.
        """
        s, v, a = motion
        q, left = self.solved(s.T)
        apart = np.flatnonzero(~(left <= CLOSED))
        q[np.ix_(apart, np.array(self.dependent))] = self.reference[list(self.dependent)]
        q = np.ascontiguousarray(q.T)
        rates = np.zeros((2, *q.shape))
        found = self._velocities
        rates[found.column, found.row] = found(q, v, a)
        return [q, rates[0], rates[1]]

    def pullback(self, q: Array, rates: Sequence[Array], slopes: Sequence[Array]) -> list[Array]:
        """Slopes with respect to the independent joints' position, velocity and acceleration, each of shape (k, N).

        Of functions with given slopes with respect to those of all joints, (n, N), in closed configurations q with the
        velocities and accelerations of the independent joints: ``dq = N dq_i`` makes it ``N'`` of all slopes with
        respect to positions, those of N among them.
        """
        found = self._velocities
        seeds = np.stack([slopes[1], slopes[2]])[found.column, found.row]
        of_q, of_v, of_a = found.pullback([q, *rates], np.ascontiguousarray(seeds))
        return [self._projected(q, slopes[0] + of_q), of_v, of_a]

    @cached_property
    def _directions(self) -> VectorisedFunction:
        q = ca.SX.sym("q", self.robot.n)
        return VectorisedFunction([q], self.directions(q))

    def drive_torques(self, q: Array, torques: Array) -> Array:
        """Torques of the drives, of the least norm, that do the same as torques of all joints, shape (N, n)."""
        # q, torques (N, n)
        N, driven = dense(self._directions, q), list(self.driven)
        found = np.zeros_like(torques)
        along = np.einsum("tnk,tn->tk", N, torques)
        found[:, driven] = np.einsum("tdk,tk->td", np.linalg.pinv(np.swapaxes(N[:, driven], 1, 2)), along)
        return found

    def at_drives(self, q: ca.SX, torques: ca.SX) -> ca.SX:
        """Torques of the drives that do the same as torques of all joints, where they are determined, shape (n, m)."""
        # q (n, 1); torques (n, m)
        if self.driven != self.independent:
            raise InputError(
                f"robot {self.robot.name!r}: its drives act on {len(self.driven)} joints, of which the loops leave "
                f"{len(self.independent)} free, so that their torques are not determined by a motion"
            )
        found, (J_d, J_i) = ca.SX(*torques.shape), self._split_jacobian(q)
        if J_d.shape[0] == J_d.shape[1]:
            _, known, *_ = self._anchors
            N_d = -eliminated(J_d, J_i, dense(VectorisedFunction([q], ca.horzcat(J_d, J_i)), known[:_PIVOTS]))
        else:
            N_d = self.directions(q)[list(self.dependent), :]
        of_free, of_others = torques[list(self.independent), :], torques[list(self.dependent), :]
        found[list(self.driven), :] = of_free + ca.mtimes(N_d.T, of_others)
        return found

    def _split_jacobian(self, q: ca.SX) -> tuple[ca.SX, ca.SX]:
        """``J_d`` and ``J_i``."""
        x = ca.SX.sym("x", self.robot.n)
        J = ca.substitute(ca.jacobian(closure_residual(self.robot, x), x), x, q)
        return J[:, list(self.dependent)], J[:, list(self.independent)]

    @cached_property
    def _anchors(self) -> tuple[scipy.spatial.KDTree, Array, Array, Array]:
        """Closed configurations all over the ranges of the independent joints: these joints, q, N and J_d.

        A range that is not limited is a turn either way.
        """
        limits = self.robot.limits
        ends = (np.where(np.isfinite(end), end, turn) for end, turn in ((limits.lower, -_TURN), (limits.upper, _TURN)))
        low, high = (end[list(self.independent)] for end in ends)
        start = self.reference[list(self.independent)]
        drawn = np.random.default_rng(0).uniform(low, high, (_ANCHORS, len(start)))
        q, left = self.reached(np.vstack([start, drawn]))
        q = q[left <= CLOSED]
        N = dense(self._directions, q)
        _, J = _split(dense(self._constraint, q))
        return scipy.spatial.KDTree(q[:, self.independent]), q, N, J[:, :, self.dependent]

    def solved(self, independent: Array) -> tuple[Array, Array]:
        """As `reached`, from the nearest of many configurations that were reached before."""  # independent (N, k)
        tree, known, N, before = self._anchors
        _, near = tree.query(independent)
        step = independent - known[near][:, self.independent]
        guess = known[near] + np.einsum("tnk,tk->tn", N[near], step)
        guess[:, self.independent] = independent
        q, left, J_d = self._closed(guess)
        same, itself = (_determinant(first, J_d) for first in (before[near], J_d))
        regular = (same > 0.0) & (itself > _NEAR**2 * _determinant(before[:1], before[:1]))
        missed = np.flatnonzero(~((left <= CLOSED) & regular))
        if missed.size:
            q[missed], left[missed] = self.reached(independent[missed])
        return q, left

    def closed(self, q: Array) -> tuple[Array, Array]:
        """Configurations from a guess of the dependent joints, and how far each is open, infinite near a singularity.

        Newton's method, at all instants at once.
        """  # q (N, n); open (N,)
        q, left, J_d = self._closed(q)
        sigma = np.linalg.svd(J_d, compute_uv=False)
        return q, np.where((left <= CLOSED) & (sigma[:, -1] < SINGULAR * sigma[:, 0]), np.inf, left)

    def _closed(self, q: Array) -> tuple[Array, Array, Array]:
        """Configurations, how far each is open, and J_d, shape (N, r, m)."""
        q, dependent, active = np.array(q, dtype=float), np.array(self.dependent), np.arange(len(q))
        for _ in range(_STEPS):
            g, J = _split(dense(self._constraint, q[active]))
            J_d = J[:, :, dependent]
            A = np.swapaxes(J_d, 1, 2) @ J_d
            A += _DAMPING * np.trace(A, axis1=1, axis2=2)[:, None, None] * np.eye(len(dependent))
            step = np.linalg.solve(A, np.einsum("krd,kr->kd", J_d, g)[:, :, None])[:, :, 0]
            size = np.abs(step).max(axis=1)
            q[np.ix_(active, dependent)] -= step * np.minimum(1.0, _STEP / np.maximum(size, _STEP))[:, None]
            active = active[size > _CONVERGED]
            if not active.size:
                break
        g, J = _split(dense(self._constraint, q))
        return q, np.abs(g).max(axis=1), J[:, :, dependent]

    def reached(self, independent: Array) -> tuple[Array, Array]:
        """The same along straight lines of the independent joints from the reference, shapes (N, n) and (N,).

        Loops do not flip on the way: what is near a singular configuration, or where J_d turns over, is not reached.
        """  # independent (N, k)
        start, moved = self.reference[list(self.independent)], list(self.independent)
        q, left = np.tile(self.reference, (len(independent), 1)), np.zeros(len(independent))
        _, _, before = self._closed(q)
        least, alive = _NEAR**2 * _determinant(before, before), np.arange(len(q))
        for part in _parts(independent - start):
            guess = q[alive]
            guess[:, moved] = start + part * (independent[alive] - start)
            q[alive], left[alive], J_d = self._closed(guess)
            closed = left[alive] <= CLOSED
            regular = (_determinant(before, J_d) > 0.0) & (_determinant(J_d, J_d) > least[alive])
            left[alive[closed & ~regular]] = np.inf
            alive, before = alive[closed & regular], J_d[closed & regular]
        q[:, moved] = independent
        return q, left

    def states(self, samples: Samples) -> Samples:
        """Those of some states in which the loops can be closed, with what the independent joints give all others."""
        q, left = self.reached(samples.q[:, self.independent])
        states = Samples(samples.time, q, samples.dq, samples.ddq, samples.dddq)
        return self.rates(states.rows(np.flatnonzero(left <= CLOSED)))

    def check(self, time: Array, q: Array, left: Array, source: str) -> None:
        """Raise `InputError` where configurations do not close the loops, or do not determine them."""
        wrong = np.flatnonzero(~(left <= CLOSED))
        if not wrong.size:
            return
        at = ", ".join(f"{name} = {q[wrong[0], k]:.4g}" for name, k in zip(self.names, self.independent, strict=True))
        first = f"at {wrong.size} of {time.size} instants, first at {time[wrong[0]]:.4g} s ({at})"
        labels = " and ".join(closure.label for closure in self.robot.closures)
        if np.isinf(left[wrong[0]]):
            others = ", ".join(self.robot.joint_names[k] for k in self.dependent)
            raise InputError(
                f"{source}: {labels} is at or beyond a singular configuration {first}, where "
                f"{listed_names(self.names)} cannot determine {others}; keep away from where bars lie in line, or "
                "check the lengths and `home`"
            )
        raise InputError(
            f"{source}: {labels} does not close {first}, where {left[wrong[0]]:.2g} m are left open; check the points "
            "of the loop, the zeros and signs of the joints, and `home`, near which the loop must close"
        )


@lru_cache(maxsize=8)
def loops_of(robot: Robot) -> Loops:
    """The loops of a robot: a closed configuration near home, and independent joints by the rank of J in it.

    Dependent joints are passive ones before all others, so that as few drives as there can be follow others.
    """
    constraint = _constraint(robot)
    q = robot.home if robot.home is not None else np.clip(np.zeros(robot.n), robot.limits.lower, robot.limits.upper)
    q, labels = np.array(q), " and ".join(closure.label for closure in robot.closures)
    for _ in range(_STEPS):
        g, J = _split(dense(constraint, q[None]))
        step = np.linalg.pinv(J[0], rcond=_RANK) @ g[0]
        q -= step * min(1.0, _STEP / max(float(np.abs(step).max()), _STEP))
    g, J = _split(dense(constraint, q[None]))
    here = f"robot {robot.name!r}: {labels}"
    if not np.abs(g).max() <= CLOSED:
        raise InputError(
            f"{here} does not close near home; {np.abs(g).max():.2g} m are left open; check the points of the loop, "
            "or state a `home` near which it closes"
        )
    sigma = np.linalg.svd(J[0], compute_uv=False)
    rank = int(np.count_nonzero(sigma > _RANK * sigma[0]))
    passive = np.array([name in robot.passive for name in robot.joint_names])
    _, _, pivots = scipy.linalg.qr(J[0] * np.where(passive, 1.0, 1e-6), mode="economic", pivoting=True)
    dependent: Index = np.sort(pivots[:rank])
    independent = tuple(k for k in range(robot.n) if k not in dependent)
    if not independent:
        raise InputError(f"{here} leaves no joint free, so nothing moves; check the loops, and which joints move")
    return Loops(robot, q, independent, tuple(dependent.tolist()))


def _parts(change: Array) -> Array:
    """Fractions of a way, small enough to go from one to the next."""
    return np.linspace(0.0, 1.0, 2 + int(np.abs(change).max(initial=0.0) / _PATH))[1:]


def _constraint(robot: Robot) -> VectorisedFunction:
    """``[g J]``, shape (r, 1 + n)."""
    q = ca.SX.sym("q", robot.n)
    g = closure_residual(robot, q)
    return VectorisedFunction([q], ca.horzcat(g, ca.jacobian(g, q)))


def _determinant(first: Array, second: Array) -> Array:
    """``det(J_1' J_2)`` at every instant, shape (N,)."""  # (N, r, m)
    return np.asarray(np.linalg.det(np.swapaxes(first, 1, 2) @ second))


def dense(function: VectorisedFunction, *inputs: Array) -> Array:
    """Values at every instant, shape (N, rows, columns)."""  # inputs (N, k)
    values = np.zeros((len(inputs[0]), *function.shape))
    found = function.seldom(*(np.ascontiguousarray(x.T) for x in inputs))
    values[:, function.row, function.column] = found.T
    return values


def _split(values: Array) -> tuple[Array, Array]:
    return values[:, :, 0], values[:, :, 1:]

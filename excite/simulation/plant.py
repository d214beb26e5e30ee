"""The simulated robot: equations of motion from its own parameters, or from an identified model.

``tau = M(q) ddq + b(q, dq) + C' f(C dq)``, with M and b from the regressor of [KD96] eq. (3): ``M = d tau / d ddq`` and
``b = tau`` at ``ddq = 0``.

Friction that grows with the load depends on ddq too; it follows drive by drive from the torque that is left.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property

import casadi as ca
import numpy as np

from regressors.errors import InputError
from regressors.models.base import Base
from regressors.models.differential import RIGID, inertial_torque
from regressors.models.drives import drive_motions, rotor_torque
from regressors.models.energy import body_energy
from regressors.models.model import RegressorModel
from regressors.robot.columns import LOAD_SHARE
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.friction.load_and_temperature import (
    carried_along,
    carried_expression,
    drives_with_friction,
    moving_drive_numbers,
    smooth_direction,
    torques_at_drives,
)
from regressors.robot.inertia import PARAMETERS_PER_LINK
from regressors.robot.plausibility import described_bodies
from regressors.robot.robot import Robot
from regressors.robot.symbolic.kinematics import bodies, sparse
from regressors.robot.symbolic.vectorised import VectorisedFunction
from regressors.samples import Array


@dataclass(frozen=True, eq=False)
class Plant:
    """A robot with numbers for all its parameters."""

    robot: Robot
    theta: Array  # (10 b,) inertial parameters of its bodies
    rotors: Array  # (r,) inertia of the rotor of every moving drive [kg m^2]
    friction: FrictionCurves

    @cached_property
    def torque(self) -> ca.Function:
        """Joint torques of (q, dq, ddq) without friction, shape (n, 1) [Nm or N]."""
        q, dq, ddq = motion = [ca.SX.sym(name, self.robot.n) for name in ("q", "dq", "ddq")]
        tau = inertial_torque(self.robot, self.theta.reshape(-1, PARAMETERS_PER_LINK), q, dq, ddq)
        drives = [drive for drive in drive_motions(self.robot, q, dq, ddq) if drive.has_rotor]
        for drive, inertia in zip(drives, self.rotors, strict=True):
            tau += drive.row.T * rotor_torque(drive) * float(inertia)
        return ca.Function("torque", motion, [ca.densify(tau)])

    def carried_torque(self, dq: ca.SX, tau: ca.SX, direction: ca.SX) -> ca.SX:
        """Joint torques minus friction, shape (n, 1) [Nm or N]."""
        return ca.densify(self.friction.carried_expression(self.robot, dq, tau, direction))

    def mass_matrix(self, q: ca.SX) -> ca.SX:
        """``M(q) = d tau / d ddq``, shape (n, n) [kg m^2, or with kg m and kg]."""
        ddq = ca.SX.sym("ddq", self.robot.n)
        return ca.jacobian(self.torque(q, ca.SX.zeros(self.robot.n, 1), ddq), ddq)

    def acceleration(self, q: ca.SX, dq: ca.SX, tau: ca.SX, direction: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Acceleration under given joint torques, ``M^-1 (tau - b - C' f(C dq, s))``."""
        # q, dq, tau (n, 1); direction (k, 1); result (n, 1)
        bias = self.torque(q, dq, ca.SX.zeros(self.robot.n, 1))
        return solved(self.mass_matrix(q), self.carried_torque(dq, tau, direction) - bias)

    @cached_property
    def energy(self) -> ca.Function:
        """Kinetic and potential energy of bodies and rotors, of (q, dq), scalar [J] [KD96] eq. (4), (5)."""
        q, dq = state = [ca.SX.sym(name, self.robot.n) for name in ("q", "dq")]
        still, gravity = ca.SX.zeros(self.robot.n, 1), ca.SX(ca.DM(self.robot.gravity))
        rows = ca.horzcat(*(body_energy(body, gravity) for body in bodies(self.robot, q, dq, still)))
        total = ca.mtimes(rows, sparse(self.theta))
        drives = [drive for drive in drive_motions(self.robot, q, dq, still) if drive.has_rotor]
        total += sum(float(I) * (drive.ratio * drive.dz) ** 2 / 2 for drive, I in zip(drives, self.rotors, strict=True))
        return ca.Function("energy", state, [total])

    def with_errors(self, relative: float, rng: np.random.Generator) -> Plant:
        """A copy with random errors, as the model of a controller.

        Each body's ten parameters are scaled by one factor, so that they stay those of a real body, and so is each
        rotor and each drive's friction; factors are uniform in ``1 +- relative``.
        """
        if relative == 0.0:
            return self
        counts = (len(self.robot.bodies), len(self.rotors), len(self.friction.curves))
        per_body, per_rotor, per_curve = (rng.uniform(1 - relative, 1 + relative, count) for count in counts)
        friction = self.friction.scaled(dict(zip(self.friction.curves, per_curve.tolist(), strict=True)))
        theta = self.theta * np.repeat(per_body, PARAMETERS_PER_LINK)
        return replace(self, theta=theta, rotors=self.rotors * per_rotor, friction=friction)


def solved(M: ca.SX, rest: ca.SX) -> tuple[ca.SX, ca.SX]:
    """``M^-1 rest`` by ``M = L D L'``, and the smallest entry of D."""  # M (n, n); rest (n, 1)
    D, LT, order = ca.ldl(M)
    return ca.densify(ca.ldl_solve(rest, D, LT, order)), ca.mmin(ca.densify(D))


def plant_of(robot: Robot, friction: FrictionCurves | None = None) -> tuple[Plant, tuple[str, ...]]:
    """Plant with a robot's own parameters, and notes on assumptions about unknown ones."""
    theta = described_bodies(robot, "so its motion cannot be simulated").ravel()
    notes: list[str] = []
    drives = () if robot.transmission is None else tuple(d for d in robot.transmission.drives if not d.rests)
    inertias = [(drive.name, drive.rotor_inertia) for drive in drives if drive.rotor_inertia is not None]
    nameless = [name for name, value in inertias if not np.isfinite(value)]
    if nameless:
        notes.append(f"rotor inertia of {', '.join(nameless)} is unknown and counts as zero")
    rotors = np.array([value if np.isfinite(value) else 0.0 for _, value in inertias])
    curves = FrictionCurves({**FrictionCurves.of_robot(robot).curves, **(friction.curves if friction else {})})
    curves.check(robot)
    without = [name for name, _ in drives_with_friction(robot) if name not in curves.curves]
    if without:
        notes.append(f"friction of {', '.join(without)} is unknown and counts as zero")
    return Plant(robot, theta, rotors, curves), tuple(notes)


Rate = Callable[[Array, Array], tuple[Array, Array]]


class ModelMotion:
    """Rate of the state (q, dq) of a model's moving coordinates, ``q = N s + q0``, under joint torques."""

    def __init__(self, model: RegressorModel, beta: Array, base: Base, friction: FrictionCurves | None) -> None:
        equations = model.torque_equations()
        assert equations is not None
        assert not equations.unused  # else the motion is not determined
        if np.shape(beta) != (base.rank,) or not np.all(np.isfinite(beta)):
            raise InputError(f"replay: expected {base.rank} finite base parameters, given {np.asarray(beta).tolist()}")
        self.N, self.q0 = equations.motion.matrix, equations.motion.offset
        self.robot, self._whole, self._friction = model.robot, equations.model, friction
        columns, beta = [base.columns[k] for k in base.index], np.asarray(beta, dtype=float)
        self._index = base.index.tolist()
        self._beta = ca.DM(np.where([c.kind == LOAD_SHARE for c in columns], 0.0, beta))
        self._rigid = ca.DM(np.where([c.group in RIGID for c in columns], beta, 0.0))
        self._shares = load_shares(model, base, beta)
        self._rates = cache(self._rates_of)

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

    def _rates_of(self, width: float) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        """State and torques as symbols, and `of` them."""
        x, tau = ca.SX.sym("x", 2 * self.k), ca.SX.sym("tau", self.k)
        return x, tau, *self.of(x, tau, width)

    def _carried(self, dq: ca.SX, tau: ca.SX, width: float) -> ca.SX:
        """Torques of the moving coordinates without the known friction."""
        if self._friction is None:
            return tau
        direction, N = smooth_direction(self.robot, dq, width), ca.DM(self.N)
        if not self._friction.loaded:
            return tau - ca.mtimes(N.T, self._friction.joint_expression(self.robot, dq, direction))
        joints = ca.mtimes(ca.DM(carried_along(self.robot, self.N)), tau)
        return ca.mtimes(N.T, self._friction.carried_expression(self.robot, dq, joints, direction))

    def function(self, width: float) -> Rate:
        """Map states, shape (2k, N), and torques, (k, N), to rates, (2k, N), and smallest pivots, (N,)."""
        x, tau, *rates = self._rates(width)
        both = VectorisedFunction([x, tau], ca.vertcat(*rates))

        def rate(state: Array, torque: Array) -> tuple[Array, Array]:
            values = np.zeros((both.shape[0], state.shape[1]))
            values[both.row] = both(state, torque)
            return values[:-1], values[-1]

        return rate

    def fastest(self, x: Array, width: float) -> float:
        """Largest eigenvalue magnitude of the motion at some states (N, 2k), moving and at rest [1/s]."""
        state, tau, rate, _ = self._rates(width)
        jacobian = ca.Function("jacobian", [state, tau], [ca.densify(ca.jacobian(rate, state))])
        still = x * np.repeat([1.0, 0.0], self.k)
        points = np.vstack([x, still])
        blocks = np.array(jacobian.map(len(points))(points.T, np.zeros((self.k, len(points)))))
        blocks = blocks.reshape(2 * self.k, len(points), 2 * self.k).transpose(1, 0, 2)
        finite = blocks[np.all(np.isfinite(blocks), axis=(1, 2))]
        return float(np.abs(np.linalg.eigvals(finite)).max(initial=0.0)) if finite.size else 0.0


_MOST = 0.99  # from 1 on, a drive would hold any load


def load_shares(model: RegressorModel, base: Base, beta: Array) -> dict[int, float]:
    """Load share of every drive that has one among the base parameters, by the drive's number."""  # beta (b,)
    composition = model.composition
    values = np.clip(composition.matrix[:, base.index] @ beta, -_MOST, _MOST).tolist()
    pairs = zip(composition.standard, values, strict=True)
    return {c.owner: share for c, share in pairs if c.kind == LOAD_SHARE and c.owner is not None}


def carried_along_motion(
    robot: Robot, shares: Mapping[int, float], N: Array, dq: ca.SX, tau: ca.SX, width: float
) -> ca.SX:
    """Torques of moving coordinates that the drives carry: tau of ``tau + F.l s |tau| = given``, drive by drive.

    The load is the identified robot's own. The model's regressor takes that of fixed parameters; both are the same
    where these are those of the estimate.
    """  # N (n, k); dq (n, 1); tau (k, 1)
    joints = ca.mtimes(sparse(carried_along(robot, N)), tau)
    to_drives, direction = torques_at_drives(robot), smooth_direction(robot, dq, width)
    z = ca.mtimes(sparse(to_drives), joints)
    loads = [
        carried_expression(z[k], shares[number] * direction[k]) if number in shares else z[k]
        for k, number in enumerate(moving_drive_numbers(robot).values())
    ]
    return ca.mtimes(sparse(N.T @ np.linalg.inv(to_drives)), ca.vertcat(*loads))

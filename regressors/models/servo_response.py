"""Response of position-controlled servos to their commands, many at once, with stick and slip.

A servo is told an angle u and holds it with a stiffness. Of a joint with the arm's own inertia m and the torque tau
that gravity and the other joints need,

    ``e = dead(u(t - d) - q - b)``                                    tracking error beyond the dead band delta
    ``tau_m = clip(K e, -L, L) - D dq``                                torque of the motor, at the joint
    ``(m + J) ddq = tau_m - tau - (Fc + mu |tau| + Fs exp(-(dq / V)^2)) sign(dq)``

L is the torque of the largest voltage at rest; a motor that turns has less, and none at the speed ``L / D``. Commands
are held between two rows. Each step is by the implicit midpoint rule, of second order; friction has the direction of
the velocity after it, so that friction that can hold the joint, holds it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

import casadi as ca
import numpy as np

from regressors.models.differential import inertial_torque
from regressors.models.servo import SCALED
from regressors.robot.plausibility import described_bodies
from regressors.robot.robot import Robot, finite_ranges
from regressors.robot.symbolic.vectorised import VectorisedFunction
from regressors.samples import Array, Index

STRIBECK_SPEED = 0.1  # V [rad/s or m/s]
LONGEST_DELAY = 0.12  # [s]
FINE, COARSE = 0.0034, 0.0101  # longest integration steps: to judge by, and to search with [s]


@dataclass(frozen=True)
class ServoQuantity:
    """One unknown of a drive."""

    name: str
    symbol: str
    unit: str
    linear_unit: str  # of a prismatic joint
    least: float
    most: float
    size: float  # typical, by which the fit scales it
    scales: bool  # whether it is a torque per something, so that only masses tell its scale
    over_stiffness: tuple[str, str] = ("", "")  # unit of its ratio to the stiffness, which no mass is needed for


QUANTITIES = (
    ServoQuantity("stiffness", "K", "Nm/rad", "N/m", 0.1, 1e5, 10.0, True),
    ServoQuantity("damping", "D", "Nm s/rad", "N s/m", 0.0, 1e4, 0.5, True, ("s", "s")),
    ServoQuantity("inertia", "J", "kg m^2", "kg", 1e-6, 1e3, 0.01, True, ("s^2", "s^2")),
    ServoQuantity("Coulomb friction", "Fc", "Nm", "N", 0.0, 1e4, 0.1, True, ("rad", "m")),
    ServoQuantity("Stribeck friction", "Fs", "Nm", "N", 0.0, 1e4, 0.1, True, ("rad", "m")),
    ServoQuantity("load share", "mu", "Nm/Nm", "N/N", 0.0, 1.0, 0.3, False),
    ServoQuantity("offset", "b", "rad", "m", -0.2, 0.2, 0.01, False),
    ServoQuantity("delay", "d", "s", "s", 0.0, LONGEST_DELAY, 0.1, False),
    ServoQuantity("dead band", "delta", "rad", "m", 0.0, 0.01, 0.005, False),
    ServoQuantity("torque limit", "L", "Nm", "N", 1e-3, 1e5, 1.0, True, ("rad", "m")),
)
SYMBOLS = tuple(quantity.symbol for quantity in QUANTITIES)
RATIOS = tuple(k for k, quantity in enumerate(QUANTITIES) if any(quantity.over_stiffness))  # to the stiffness


@runtime_checkable
class Servos(Protocol):
    """Servos of all joints of an arm, as they are identified."""

    @property
    def robot(self) -> Robot:
        """The arm, whose masses set the scale."""

    @property
    def values(self) -> Array:
        """Of each joint, the quantities of `QUANTITIES`, shape (n, p)."""

    @property
    def half_width(self) -> Array:
        """Half of their 99 % intervals, shape (n, p); infinite for what is not known."""


@dataclass(frozen=True, eq=False)
class Windows:
    """Stretches of motion of as many rows, each of one joint, from a state on.

    What the arm needs is given at rows, or at several even instants of each.
    """

    step: Array  # (w,) between rows [s]
    command: Array  # (w, lead + T), held from each row on; the first `lead` rows are before the stretch [rad or m]
    load: Array  # (w, 1 + (T - 1) m) torque that gravity and the other joints need [Nm or N]
    inertia: Array  # (w, 1 + (T - 1) m) own inertia of the arm at the joint [kg m^2 or kg]
    measured: Array  # (w, T) [rad or m]
    start: Array  # (w,) position at the start [rad or m]
    speed: Array  # (w,) at the start [rad/s or m/s]
    longest_step: float = FINE  # of the integration [s]

    @property
    def lead(self) -> int:
        """Rows of commands before the stretch."""
        return int(self.command.shape[1] - self.measured.shape[1])

    @property
    def substeps(self) -> int:
        """Integration steps between two rows."""
        return math.ceil(float(self.step.max()) / self.longest_step)


def response(values: Array, windows: Windows) -> Array:
    """Positions of servos of given parameters from the start of each stretch on.

    Parameters
    ----------
    values : ndarray, shape (B, 1 or w, p)
        Of B variants, the p quantities of `QUANTITIES` of all stretches or of each.
    windows : Windows

    Returns
    -------
    ndarray, shape (B, w, T)
        [rad or m]
    """
    substeps = windows.substeps
    path = np.empty((windows.measured.shape[1], len(values), len(windows.start)))
    path[0] = windows.start
    for k, (q, _) in enumerate(_states(values, windows), 1):
        if k % substeps == 0:
            path[k // substeps] = q
    return np.moveaxis(path, 0, -1)


def _states(values: Array, windows: Windows) -> Iterator[tuple[Array, Array]]:
    """Positions and velocities after each integration step, each (B, w)."""
    K, D, J, Fc, Fs, mu, b, d, delta, L = np.moveaxis(values, -1, 0)
    substeps, rows = windows.substeps, windows.measured.shape[1]
    h = windows.step / substeps
    shape = (len(values), len(windows.start))
    q, dq = (np.array(np.broadcast_to(each, shape)) for each in (windows.start, windows.speed))
    loads, inertias = (_midway(each, rows, substeps) for each in (windows.load, windows.inertia))
    parts = [_held(windows, d / windows.step, part / substeps, substeps) for part in range(1, substeps + 1)]
    damped, quarter, steady, slips = 0.5 * h * D, 0.25 * h * K, h * Fc, bool(Fs.any())
    told = windows.command.T.ravel()
    for k, (load, inertia) in enumerate(zip(loads, inertias, strict=True)):
        row, part = divmod(k, substeps)
        ahead, own = q + b + 0.5 * h * dq, inertia + J
        pull, springs = -0.5 * D * dq - load, np.zeros(shape)
        for share, place in parts[part]:
            e = told[row * shape[1] :].take(place) - ahead
            spring = K * np.copysign(np.maximum(np.abs(e) - delta, 0.0), e)
            limited = np.minimum(np.maximum(spring, -L), L)
            pull += share * limited
            springs += share * ((limited == spring) & (spring != 0.0))
        pull += springs * quarter * dq
        pull *= h
        pull += own * dq
        resisting = steady + (h * np.abs(load)) * mu
        if slips:
            resisting = resisting + h * Fs * np.exp(-np.square(dq * (1.0 / STRIBECK_SPEED)))
        last, dq = dq, np.copysign(np.maximum(np.abs(pull) - resisting, 0.0), pull)
        dq /= own + damped + springs * (h * quarter)
        q = q + 0.5 * h * (last + dq)
        yield q, dq


def _midway(values: Array, rows: int, substeps: int) -> Array:
    """Values in the middle of each integration step, shape ((T - 1) substeps, w)."""
    each = (values.shape[1] - 1) // (rows - 1)
    place = (np.arange((rows - 1) * substeps) + 0.5) * each / substeps
    before = place.astype(np.intp)
    share = (place - before)[:, None]
    return np.asarray((1.0 - share) * values.T[before] + share * values.T[before + 1])


def _held(windows: Windows, late: Array, end: float, substeps: int) -> list[tuple[Any, Index]]:
    """Shares of the integration step that ends at a part of a row, and the places of the command that is held in each.

    Places are those in commands of shape (lead + T, w), flat, for the first row of the stretch.
    """
    # late (B, 1 or w) rows
    count = len(windows.start)
    row = np.broadcast_to(end - late, (len(late), count))
    before = np.floor(row)
    passed = np.clip((row - before) * substeps, 0.0, 1.0)
    now = np.maximum(windows.lead + before, 1).astype(np.intp) * count + np.arange(count)
    if ((passed == 0.0) | (passed == 1.0)).all():
        return [(1.0, now - count * (passed == 0.0))]
    return [(1.0 - passed, now - count), (passed, now)]


@dataclass(frozen=True, eq=False)
class ArmResponse:
    """Motion of the servos of all joints together in several stretches, after each integration step."""

    q: Array  # (s, M, n) [rad or m]
    dq: Array  # (s, M, n) [rad/s or m/s]
    load: Array  # (s, M, n) torque that gravity and the other joints need [Nm or N]
    inertia: Array  # (s, M, n) own inertia of the arm at each joint
    substeps: int  # between two rows


_PASSES, _SETTLED = 20, 1e-4  # at most, and the change of the motion from which on no more are made [rad or m]
FAR = 100.0  # of an arm that falls, since its servos are too weak [rad or m]


def arm_response(
    robot: Robot, values: Array, command: Array, step: Array, first: Array, speed: Array, passes: int = _PASSES
) -> ArmResponse:
    """Motion that servos make of commands, each servo under what the arm needs along the motion of all.

    That follows from the motion, and the motion from it; so both are computed in turn until the motion settles.

    Parameters
    ----------
    robot : Robot
        The arm with known masses.
    values : ndarray, shape (n, p)
        Of each joint's servo.
    command : ndarray, shape (s, lead + T, n)
        Of each stretch, held from each row on [rad or m].
    step : ndarray, shape (s,)
        Between rows [s].
    first : ndarray, shape (s, T, n)
        A motion to begin with, from the state on that each stretch starts from [rad or m].
    speed : ndarray, shape (s, n)
        Of that state [rad/s or m/s].
    passes : int
        At most.
    """
    count, _, n = first.shape
    needs = arm_torques(robot)
    own = np.repeat(values[None], count, axis=0).reshape(1, -1, values.shape[1])

    def along(q: Array, dq: Array, between: Array) -> tuple[Array, Array]:
        ddq = np.gradient(dq, axis=1) / between[:, None, None]
        load, inertia = needs(*(each.reshape(-1, n) for each in (q, dq, ddq)))
        return load.reshape(q.shape), inertia.reshape(q.shape)

    def flat(each: Array) -> Array:
        return np.moveaxis(each, -1, 1).reshape(count * n, -1)

    load, inertia = along(first, np.gradient(first, axis=1) / step[:, None, None], step)
    windows = Windows(
        np.repeat(step, n), flat(command), flat(load), flat(inertia), flat(first), first[:, 0].ravel(), speed.ravel()
    )
    substeps = windows.substeps
    share, change = np.ones((count, 1, 1)), np.full(count, np.inf)
    path: Array = first
    rates: Array = first
    for number in range(passes):
        states = [(windows.start[None], windows.speed[None]), *_states(own, windows)]
        q, dq = (np.array([state[k][0] for state in states]).reshape(-1, count, n).swapaxes(0, 1) for k in (0, 1))
        if number:
            last, change = change, np.abs(q - path).max(axis=(1, 2))
            share = np.where((change > last)[:, None, None], 0.5 * share, share)  # coupled fast joints would grow
            q, dq = path + share * (q - path), rates + share * (dq - rates)
        path, rates = q, dq
        load, inertia = along(q, dq, step / substeps)
        windows = replace(windows, load=flat(load), inertia=flat(inertia))
        if change.max() < _SETTLED or (np.isfinite(change) & (change > FAR)).any():
            break
    return ArmResponse(path, rates, load, inertia, substeps)


def arm_torques(robot: Robot) -> Callable[[Array, Array, Array], tuple[Array, Array]]:
    """What the described arm needs at each joint along a motion, from q, dq, ddq, each (N, n).

    The torque without that of the joint's own inertia, ``tau_j - M_jj ddq_j``, and that inertia, each (N, n).
    """
    theta = described_bodies(robot, SCALED)
    q, dq, ddq = (ca.SX.sym(name, robot.n) for name in ("q", "dq", "ddq"))
    tau = inertial_torque(robot, theta, q, dq, ddq)
    own = ca.diag(ca.jacobian(tau, ddq))
    function = VectorisedFunction([q, dq, ddq], ca.vertcat(tau - own * ddq, own))

    def along(*motion: Array) -> tuple[Array, Array]:
        values = np.zeros((2 * robot.n, len(motion[0])))
        values[function.row] = function(*(np.ascontiguousarray(each.T) for each in motion))
        load, inertia = np.split(values.T, 2, axis=1)
        return load, inertia

    return along


_POSES = 1000  # looked at
_LITTLE = 0.02  # of the torque limit: less is lost in friction
_FAST = 20.0  # acceleration of fast motion where no limit of it is stated [rad/s^2 or m/s^2]


def scale_shown_by(robot: Robot) -> list[tuple[float, float, str]]:
    """Of each joint, the largest torque of gravity and own inertia of the arm, and what shows how large torques are.

    Commands and positions alone show all torques of a servo as shares of its stiffness; how large they are is shown by
    what the known masses ask of it: gravity in any motion, inertia in fast motion, each where it is no small share of
    the torque limit; where none is stated, of the largest of all joints. Poses are random, seeded.
    """
    limits = robot.limits
    q = np.random.default_rng(0).uniform(*finite_ranges(robot), (_POSES, robot.n))
    load, inertia = (np.abs(each).max(axis=0).round(9) for each in arm_torques(robot)(q, 0.0 * q, 0.0 * q))
    fast = inertia * np.where(np.isfinite(limits.acceleration), limits.acceleration, _FAST)
    least = _LITTLE * np.where(np.isfinite(limits.torque), limits.torque, max(load.max(), fast.max()))
    words = np.where(load > least, "gravity", np.where(fast > least, "fast motion", "a known mass in hand"))
    return list(zip(load.tolist(), inertia.tolist(), words.tolist(), strict=True))

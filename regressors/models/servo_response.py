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
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import casadi as ca
import numpy as np

from regressors.models.differential import inertial_torque
from regressors.models.servo import described_bodies
from regressors.robot.robot import Robot
from regressors.robot.symbolic.vectorised import VectorisedFunction
from regressors.samples import Array

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


QUANTITIES = (
    ServoQuantity("stiffness", "K", "Nm/rad", "N/m", 0.1, 1e5, 10.0, True),
    ServoQuantity("damping", "D", "Nm s/rad", "N s/m", 0.0, 1e4, 0.5, True),
    ServoQuantity("inertia", "J", "kg m^2", "kg", 1e-6, 1e3, 0.01, True),
    ServoQuantity("Coulomb friction", "Fc", "Nm", "N", 0.0, 1e4, 0.1, True),
    ServoQuantity("Stribeck friction", "Fs", "Nm", "N", 0.0, 1e4, 0.1, True),
    ServoQuantity("load share", "mu", "Nm/Nm", "N/N", 0.0, 3.0, 0.3, False),
    ServoQuantity("offset", "b", "rad", "m", -0.2, 0.2, 0.01, False),
    ServoQuantity("delay", "d", "s", "s", 0.0, LONGEST_DELAY, 0.1, False),
    ServoQuantity("dead band", "delta", "rad", "m", 0.0, 0.01, 0.005, False),
    ServoQuantity("torque limit", "L", "Nm", "N", 1e-3, 1e5, 1.0, True),
)
SYMBOLS = tuple(quantity.symbol for quantity in QUANTITIES)


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
    """Stretches of motion of as many rows, each of one joint, from a measured state on."""

    step: Array  # (w,) between rows [s]
    command: Array  # (w, lead + T), held from each row on; the first `lead` rows are before the stretch [rad or m]
    load: Array  # (w, T) torque that gravity and the other joints need [Nm or N]
    inertia: Array  # (w, T) own inertia m of the arm at the joint [kg m^2 or kg]
    measured: Array  # (w, T) [rad or m]
    speed: Array  # (w,) at the start [rad/s or m/s]
    longest_step: float = FINE  # of the integration [s]

    @property
    def lead(self) -> int:
        """Rows of commands before the stretch."""
        return int(self.command.shape[1] - self.load.shape[1])


def response(values: Array, windows: Windows) -> Array:
    """Positions of servos of given parameters that start as measured.

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
    K, D, J, Fc, Fs, mu, b, d, delta, L = np.moveaxis(values, -1, 0)
    count, rows = windows.load.shape
    substeps = math.ceil(windows.step.max() / windows.longest_step)
    h = windows.step / substeps
    shape = (len(values), count)
    q, dq = (np.array(np.broadcast_to(each, shape)) for each in (windows.measured[:, 0], windows.speed))
    path = np.empty((rows, *shape))
    path[0] = q
    damped, quarter = 0.5 * h * D, 0.25 * h * K
    told, late = windows.command.T, d / (windows.step if d.shape[1] > 1 else windows.step.mean())
    for k in range(1, rows):
        own, before = windows.inertia[:, k] + J, windows.load[:, k - 1]
        for part in range(1, substeps + 1):
            load = before + (part - 0.5) / substeps * (windows.load[:, k] - before)
            ahead = q + b + 0.5 * h * dq
            pull, springs = -0.5 * D * dq - load, np.zeros(shape)
            for share, u in _held(told, windows.lead + k - 1 + part / substeps - late, substeps):
                e = u - ahead
                spring = K * np.copysign(np.maximum(np.abs(e) - delta, 0.0), e)
                pull += share * np.clip(spring, -L, L)
                springs += share * ((spring != 0.0) & (np.abs(spring) < L))
            pull += springs * quarter * dq
            pull *= h
            pull += own * dq
            resisting = h * (Fc + mu * np.abs(load) + Fs * np.exp(-np.square(dq * (1.0 / STRIBECK_SPEED))))
            last, dq = dq, np.copysign(np.maximum(np.abs(pull) - resisting, 0.0), pull)
            dq /= own + damped + springs * (h * quarter)
            q = q + 0.5 * h * (last + dq)
        path[k] = q
    return np.moveaxis(path, 0, -1)


def _held(told: Array, row: Array, substeps: int) -> list[tuple[Any, Array]]:
    """Commands, each (B, w), in the substep before rows that need not be whole, and their shares of its time."""
    # told (lead + T, w); row (B, 1 or w)
    before = np.clip(np.floor(row), 1, len(told) - 1).astype(np.intp)
    passed = np.clip((row - before) * substeps, 0.0, 1.0)
    if row.shape[1] == 1:
        last, now = told[before[:, 0] - 1], told[before[:, 0]]
    else:
        every = np.arange(told.shape[1])
        last, now = told[before - 1, every], told[before, every]
    if ((passed == 0.0) | (passed == 1.0)).all():
        return [(1.0, np.where(passed == 1.0, now, last))]
    return [(1.0 - passed, last), (passed, now)]


def arm_torques(robot: Robot) -> Callable[[Array, Array, Array], tuple[Array, Array]]:
    """What the described arm needs at each joint along a motion, from q, dq, ddq, each (N, n).

    The torque without that of the joint's own inertia, ``tau_j - M_jj ddq_j``, and that inertia, each (N, n).
    """
    theta = described_bodies(robot)
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

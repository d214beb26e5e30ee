"""Sensor models: counts of encoders on the motors, and white noise."""

from __future__ import annotations

import casadi as ca
import numpy as np

from excite.simulation.settings import one_each
from regressors.errors import InputError
from regressors.robot.gears import GearFunction
from regressors.robot.robot import Robot
from regressors.samples import Array
from regressors.symbolic.vectorised import VectorisedFunction

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)
_NEWTON = 2  # each iteration squares an error that begins as one count


def motor_angle(gear: GearFunction, z: Array) -> tuple[Array, Array]:
    """Angle ``F(z) - F(0) = int_0^z F'(s) ds`` of a motor, by Gauss-Legendre quadrature, and its ratio ``F'(z)``."""
    # z (N,); result (N,)
    symbol = ca.SX.sym("z")
    ratio = VectorisedFunction([symbol], gear.ratio(symbol))
    values = np.concatenate([ratio(z[None] * x) for x in (_NODES + 1) / 2])
    return _WEIGHTS @ values / 2 * z, ratio(z[None])[0]


def quantised(robot: Robot, q: Array, counts: tuple[float, ...]) -> Array:
    """Joint positions as measured by encoders on the motors.

    Each motor's angle F(z) is rounded to whole counts and mapped back through the gear, by Newton's method, and the
    coupling, ``q = C^-1 (z - z0)``. Without a transmission the counts are per revolution of the joint.
    """  # q (N, n)
    per_drive = one_each(counts, robot.n, "encoder", "moving drive")
    transmission = robot.transmission
    if transmission is None:
        sizes = 2 * np.pi / np.array(per_drive)
        return np.asarray(np.round(q / sizes) * sizes)
    own = [k - 1 for k in robot.link_numbers if k <= len(transmission.drives)]
    C, z0 = transmission.coupling[own], transmission.offset[own]
    if C.shape[0] != robot.n or np.linalg.matrix_rank(C) < robot.n:
        raise InputError(
            f"robot {robot.name!r}: its drives do not determine its joints, so encoders do not measure positions"
        )
    z = q @ C.T + z0
    for k, drive in enumerate(own):
        size = 2 * np.pi / per_drive[k]
        gear = transmission.drives[drive].ratio
        counted = np.round(motor_angle(gear, z[:, k])[0] / size) * size
        for _ in range(_NEWTON):
            angle, ratio = motor_angle(gear, z[:, k])
            z[:, k] += (counted - angle) / ratio
    return np.asarray((z - z0) @ np.linalg.inv(C).T)


def noisy(values: Array, deviation: tuple[float, ...], what: str, rng: np.random.Generator) -> Array:
    """Values with white Gaussian noise."""  # values (N, n)
    sigma = np.array(one_each(deviation, values.shape[1], what))
    return np.asarray(values + rng.standard_normal(values.shape) * sigma)

"""Payload identified from joint torques: ten additional parameters in the motions with the load."""

from __future__ import annotations

import casadi as ca
import numpy as np

from regressors.models.load import LOAD_PARAMETERS
from regressors.models.model import evaluate_samples
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples
from regressors.symbolic.body import body_regressor
from regressors.symbolic.kinematics import chain
from regressors.symbolic.vectorised import VectorisedFunction

PREFIX = "load."
NAMES = tuple(PREFIX + name for name in LOAD_PARAMETERS)


def load_regressor(robot: Robot, samples: Samples) -> Array:
    """Joint torques per parameter of a load fixed to the last link, about that link's frame.

    ``tau_j = l_j' F + s_j' N`` with ``[F; N] = K phi`` of the last link's frame [KD96] eq. (8)-(10).

    Parameters
    ----------
    robot : Robot
    samples : Samples
        N instants.

    Returns
    -------
    ndarray, shape (N n, 10)
        Rows of the first instant, then of the second, and so on [Nm or N, per unit parameter].
    """
    symbols = [ca.SX.sym(name, robot.n) for name in ("q", "dq", "ddq")]
    *_, last = chain(robot, *symbols)
    force, moment = body_regressor(last.omega, last.domega, last.a)
    rows = [ca.mtimes(linear.T, force) + ca.mtimes(angular.T, moment) for angular, linear in last.axes]
    values = evaluate_samples(VectorisedFunction(symbols, ca.vertcat(*rows)), samples)
    return np.asarray(values.reshape(-1, len(LOAD_PARAMETERS)))

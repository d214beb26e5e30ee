"""Payload identified from joint torques: ten additional parameters in the motions with the load."""

from __future__ import annotations

from regressors.models.load import LOAD_PARAMETERS, PayloadModel
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

PREFIX = "load."
NAMES = tuple(PREFIX + name for name in LOAD_PARAMETERS)


def load_regressor(robot: Robot, samples: Samples) -> Array:
    """Joint torques per parameter of a load fixed to the last link, about that link's frame.

    ``tau_j = l_j' F + s_j' N`` with ``[F; N] = K phi`` of the last link's frame [KD96] eq. (8)-(10).
    """
    return PayloadModel(robot).instants(samples)

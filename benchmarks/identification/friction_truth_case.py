"""What the study of friction curves takes as the truth, and what it measures with."""

from __future__ import annotations

import numpy as np

from excite.friction.friction_equations import Form
from regressors.readers.library import load_robot
from regressors.robot.friction.curve import Stribeck
from regressors.robot.friction.curves import Side
from regressors.samples import Array

ROBOT = load_robot("irp6")
TRUTH = {
    "z1": Stribeck(Side(9.0, 25.0, 14.1, 0.12, 1.0), Side(9.0, 25.0, 14.1, 0.12, 1.0)),
    "z2": Stribeck(Side(11.0, 26.0, 16.8, 0.12, 1.0), Side(7.0, 26.0, 10.6, 0.12, 1.0)),
    "z3": Stribeck(Side(12.0, 26.0, 18.0, 0.12, 1.0), Side(9.4, 26.0, 14.1, 0.12, 1.0)),
}
RATE, NOISE, ENCODER = 1000.0, 1.0, 4000.0  # Hz, Nm of each joint, counts per motor revolution
EXPERIMENTS, FEWER = 500, 100  # FEWER of the planned experiment with exact positions
FORM = Form("asymmetric Tustin", stribeck=True, asymmetric=True, exponent=1.0)
NAMES = ("coulomb", "viscous", "stiction", "stribeck")


def true_values(drive: str) -> Array:
    """Parameters of the form, of both directions."""
    return np.array([getattr(side, k) for side in (TRUTH[drive].forward, TRUTH[drive].backward) for k in NAMES])


def noise(seed: int, shape: tuple[int, ...], number: int = 0) -> Array:
    """White noise of the joint torques of an experiment's log."""
    return np.random.default_rng([seed, number]).normal(0.0, NOISE, shape)


def shares(errors: Array, halves: Array, bias: Array) -> dict[str, list[float]]:
    """How many of the intervals contain the truth, as they are and with the bias taken off [%].

    Parameters
    ----------
    errors, halves : ndarray, shape (N, k)
    bias : ndarray, shape (k,)
    """
    return {
        "bias": bias.tolist(),
        "interval99": np.median(halves, axis=0).tolist(),
        "within_percent": (100 * np.mean(np.abs(errors) <= halves, axis=0)).tolist(),
        "within_percent_without_bias": (100 * np.mean(np.abs(errors - bias) <= halves, axis=0)).tolist(),
    }

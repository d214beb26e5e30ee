"""Friction curves, and how uncertain they are, for the tests of friction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from regressors.robot.friction.curve import CoulombViscous, FrictionCurve, Stribeck
from regressors.robot.friction.curves import Side
from regressors.robot.friction.load_and_temperature import Loaded, Slope, Warm
from regressors.robot.friction.uncertainty import CurveUncertainty
from regressors.robot.robot import Robot

TUSTIN = Stribeck(Side(14.0, 26.0, 16.8, 0.05, 1.0), Side(9.0, 20.0, 10.6, 0.08, 2.0), 0.4)
CURVES: dict[str, FrictionCurve] = {
    "z1": CoulombViscous(28.0, 26.0, -0.7),
    "z2": Loaded(Warm(TUSTIN, 30.0, Slope(-0.1, 0.02), Slope(-0.2, 0.03)), 0.02, 0.03),
    "z3": Warm(CoulombViscous(13.0, 9.0), 30.0, Slope(-0.1, 0.2)),
}


def uncertain(parameters: tuple[str, ...], seed: int, size: float = 0.02) -> CurveUncertainty:
    """Correlated uncertainty of some parameters."""
    root = size * np.random.default_rng(seed).normal(size=(len(parameters), len(parameters)))
    return CurveUncertainty(parameters, root @ root.T)


KNOWN = {
    "z1": uncertain(("coulomb", "viscous", "offset"), 1, 0.3),
    "z2": uncertain(
        ("forward.coulomb", "backward.stiction", "stribeck", "temperature.coulomb", "load.forward", "offset"), 2, 0.003
    ),
    "z3": uncertain(("temperature.viscous", "viscous"), 3),
}


def without_friction(robot: Robot) -> Robot:
    """The robot whose description states no friction."""
    drives = tuple(replace(drive, coulomb=None, viscous=None) for drive in robot.transmission.drives)
    return robot.replace(transmission=replace(robot.transmission, drives=drives))

"""Deviations of the standard parameters that a description states, from a relative uncertainty."""

from __future__ import annotations

import numpy as np

from regressors.models.nominal import standard_values
from regressors.robot.inertia import inertia_tensor, parameter_names
from regressors.robot.robot import Robot


def stated_deviations(robot: Robot, relative: float) -> dict[str, float]:
    """Deviations of the standard parameters that a description states, relative to the quantities they belong to.

    The deviation of a link's mass is ``relative`` of it, that of each component of its first moment ``relative`` of the
    moment's length, that of each entry of its inertia tensor ``relative`` of the largest principal moment: a component
    that happens to be zero is not thereby exact. Rotor inertias and friction coefficients are scaled individually. A
    quantity that is stated as zero counts as unknown.
    """
    sizes = {name: abs(value) for name, value in standard_values(robot).items()}
    for number, body in zip(robot.body_numbers, robot.bodies, strict=True):
        if body.theta is not None:
            largest = float(np.abs(np.linalg.eigvalsh(inertia_tensor(body.theta))).max())
            magnitudes = [float(body.theta[0])] + 3 * [float(np.linalg.norm(body.theta[1:4]))] + 6 * [largest]
            sizes.update(zip(parameter_names(number), magnitudes, strict=True))
    return {name: relative * size for name, size in sizes.items() if size > 0.0}

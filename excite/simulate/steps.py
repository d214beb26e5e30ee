"""How finely a controlled robot must be integrated, and how abruptly friction may turn then."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from excite.simulate.controlled import ControlledRobot
from excite.simulate.reference import Reference
from regressors.errors import InputError
from regressors.samples import Samples

_REACH = 1.5  # of substep times fastest rate; the method is stable up to 2.78
_MOST_SUBSTEPS, _CHEAP_SUBSTEPS = 64, 3
_SOFTEST = 1e-3  # of the largest wanted velocity: the sign of friction turns within it, where the substep allows
_PROBES = 40


@dataclass(frozen=True)
class Steps:
    """How finely a motion is integrated.

    Parameters
    ----------
    substeps : int
        Steps of the method per sample.
    width : float
        Velocity over which the sign of friction turns [rad/s or m/s].
    widened : bool
        True if the width had to grow for the method to be stable.
    """

    substeps: int
    width: float
    widened: bool = False


def steps_for(robot: ControlledRobot, reference: Reference, rate: float, width: float | None) -> Steps:
    """Substeps that are stable for a motion, and the width of friction's sign.

    The rates are the eigenvalues of the controlled robot about the wanted motion, at rest too, where friction is
    steepest: ``F / (width M)``. The product of substep and fastest rate stays below 1.5.

    Parameters
    ----------
    robot : ControlledRobot
    reference : Reference
    rate : float
        Samples per second [Hz].
    width : float or None
        None for one that suits the motion: a thousandth of its largest velocity, or what 3 substeps allow.

    Raises
    ------
    InputError
        More than 64 substeps per sample would be needed.
    """
    probes = reference.samples(np.linspace(0.0, reference.duration, _PROBES))
    jacobian = robot.fastest_rate()

    def needed(width: float) -> int:
        return max(1, int(np.ceil(_fastest(jacobian, probes, width) / (rate * _REACH))))

    if width is not None:
        substeps = needed(width)
        if substeps > _MOST_SUBSTEPS:
            raise InputError(
                f"sign_width {width:g}: friction that turns so abruptly needs {substeps} substeps per sample at "
                f"{rate:g} Hz, more than {_MOST_SUBSTEPS}; expected a width of about "
                f"{width * substeps / _MOST_SUBSTEPS:.2g} or more, or a higher rate"
            )
        return Steps(substeps, width)
    width = start = _SOFTEST * (float(np.abs(probes.dq).max()) or 1.0)
    while (substeps := needed(width)) > _CHEAP_SUBSTEPS and width < 100 * start:
        width *= 1.25
    if substeps > _MOST_SUBSTEPS:
        raise InputError(
            f"the controller needs {substeps} steps per sample at {rate:g} Hz, more than {_MOST_SUBSTEPS}; "
            "take a lower bandwidth or a higher rate"
        )
    return Steps(substeps, width, widened=width > start)


def _fastest(jacobian: ca.Function, probes: Samples, width: float) -> float:
    """Largest eigenvalue's magnitude at the probes, moving and at rest [1/s]."""
    count = probes.time.size
    still = np.zeros_like(probes.dq)
    reference = np.hstack([probes.q, probes.dq, probes.ddq])
    largest = 0.0
    for dq in (probes.dq, still):
        state = np.hstack([probes.q, dq, np.zeros((count, 2))])
        stacked = np.array(jacobian.map(count)(state.T, reference.T, width))
        blocks = stacked.reshape(stacked.shape[0], count, -1).transpose(1, 0, 2)
        if not np.all(np.isfinite(blocks)):
            raise InputError("the robot's equations of motion have no solution: its mass matrix is singular")
        largest = max(largest, float(np.abs(np.linalg.eigvals(blocks)).max()))
    return largest

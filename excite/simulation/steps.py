"""Choice of integration steps for a controlled robot, and of the width of friction's sign change."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import casadi as ca
import numpy as np

from excite.simulation.control import ControlledRobot
from excite.simulation.direction import Sticking, leads
from excite.simulation.reference import Reference
from regressors.errors import InputError
from regressors.samples import Samples

_REACH = 1.5  # of substep times fastest rate; the method is stable up to 2.78
_MOST_SUBSTEPS, _CHEAP_SUBSTEPS = 64, 3
_STICKING_SUBSTEPS = 10  # accepted for a short distance, which falls with their square
_SOFTEST = 1e-3  # of the largest desired velocity: the sign of friction changes within it, where the substep allows
_BREAKAWAY = 1e-5  # rad or m: distance of presliding, where the substep allows
_PROBES = 40


@dataclass(frozen=True)
class Steps:
    """Integration steps of a motion, and the width of friction's sign change.

    Parameters
    ----------
    substeps : int
        Steps of the method per sample.
    width : float
        Velocity over which the sign of friction changes; with presliding, that of its compensation by the controller
        [rad/s or m/s].
    widened : bool
        True if the width, or the distance, had to grow for the method to be stable.
    sticking : Sticking, optional
        Presliding friction; the sign changes with velocity if not given.
    """

    substeps: int
    width: float
    widened: bool = False
    sticking: Sticking | None = None


def steps_for(
    robot: ControlledRobot,
    reference: Reference,
    rate: float,
    width: float | None,
    breakaway: float | Literal["auto"] | None = None,
) -> Steps:
    """Stable substeps for a motion, with the width of friction's sign or the presliding distance.

    The rates are the eigenvalues of the controlled robot about the desired motion, and at rest, where friction is
    steepest: ``F / (width M)``, or ``sqrt(2 F / (d M))`` with presliding. The product of substep and fastest rate stays
    below 1.5.
    """
    probes = reference.samples(np.linspace(0.0, reference.duration, _PROBES))
    softest = _SOFTEST * (float(np.abs(probes.dq).max()) or 1.0)
    lead = None if breakaway is None else leads(robot.plant, (probes.q.min(axis=0) + probes.q.max(axis=0)) / 2)
    jacobian = robot.fastest_rate(lead)

    def needed(size: float) -> int:
        return max(1, int(np.ceil(_fastest(jacobian, probes, size) / (rate * _REACH))))

    distance = None if breakaway is None or isinstance(breakaway, str) else float(breakaway)
    given = width if breakaway is None else distance
    start = softest if breakaway is None else _BREAKAWAY
    enough = _CHEAP_SUBSTEPS if breakaway is None else _STICKING_SUBSTEPS
    size = start if given is None else given
    substeps = needed(size)
    if given is None:
        while substeps > enough and size < 100 * start:
            size *= 1.25
            substeps = needed(size)
    if substeps > _MOST_SUBSTEPS:
        raise _too_many(substeps, rate, width, distance)
    widened = given is None and size > start
    if lead is None:
        return Steps(substeps, size, widened)
    return Steps(substeps, softest, widened, Sticking(size, tuple((lead * np.sqrt(size)).tolist())))


def _too_many(substeps: int, rate: float, width: float | None, breakaway: float | None) -> InputError:
    times = substeps / _MOST_SUBSTEPS
    if breakaway is not None:
        what, enough = f"breakaway {breakaway:g}", f"a distance of about {breakaway * times**2:.2g}"
    elif width is not None:
        what, enough = f"sign_width {width:g}", f"a width of about {width * times:.2g}"
    else:
        return InputError(
            f"the controller needs {substeps} steps per sample at {rate:g} Hz, more than {_MOST_SUBSTEPS}; "
            "take a lower bandwidth or a higher rate"
        )
    return InputError(
        f"{what}: such an abrupt change of friction needs {substeps} substeps per sample at {rate:g} Hz, more than "
        f"{_MOST_SUBSTEPS}; expected {enough} or more, or a higher rate"
    )


def _fastest(jacobian: ca.Function, probes: Samples, size: float) -> float:
    """Largest eigenvalue magnitude at the probes, moving and at rest [1/s]."""
    count = probes.time.size
    still = np.zeros_like(probes.dq)
    reference = np.hstack([probes.q, probes.dq, probes.ddq])
    largest = 0.0
    for dq in (probes.dq, still):
        state = np.hstack([probes.q, dq])
        stacked = np.array(jacobian.map(count)(state.T, reference.T, size))
        blocks = stacked.reshape(stacked.shape[0], count, -1).transpose(1, 0, 2)
        if not np.all(np.isfinite(blocks)):
            raise InputError("the robot's equations of motion have no solution: its mass matrix is singular")
        largest = max(largest, float(np.abs(np.linalg.eigvals(blocks)).max()))
    return largest

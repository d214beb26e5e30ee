"""Bodies and drives that reproduce identified base parameters: the physically consistent ones nearest the described.

Of the many standard parameters with ``A theta = beta`` those nearest the described ones are taken whose bodies have
positive definite pseudo-inertias and whose drives have rotor inertias and friction of zero or more [Wensing, Kim,
Slotine 2018]. Where there are none, ``min (A theta - beta)' Sigma^-1 (A theta - beta)`` with the covariance of beta.

Only the sum is identifiable. The members keep what their description says and the moving body takes the difference,
where that leaves it a physically possible body; else the others are scaled down until it does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from excite.errors import ConicSolverError
from excite.identification.estimators.physical import nearest_possible
from excite.identification.estimators.possible_set import StandardProblem, problem_of_factor
from excite.information.target import IdentificationTarget
from regressors.errors import listed_names
from regressors.models.base import random_states, triangular_factor
from regressors.robot.inertia import from_pseudo_inertia, pseudo_inertia
from regressors.robot.robot import Structure
from regressors.samples import Array, Samples

STATES = 500
_SAME = 1e-10  # of the torques: rounding
_SHARES = (0.5, 0.1, 0.01)  # of its description that every body keeps, where that is possible
_CLOSE = 1e-2  # of a parameter's size, in which nearness to the description is measured
_NOISE = 1e-2  # of the torques, where no covariance says how well they are known


@dataclass(frozen=True, eq=False)
class NearestBodies:
    """Standard parameters of the moving robot that stand for identified base parameters."""

    values: dict[str, float]  # standard parameters of bodies and drives
    # ``||W theta - W_b beta|| / ||W_b beta||`` over random states: what the bodies change of the predicted torques
    change: float
    shares: dict[str, float]  # of every standard parameter: torque on the random states over that of the whole model
    # True if they are those that the estimator found, which alone reproduce the base parameters
    estimated: bool = False

    @property
    def exact(self) -> bool:
        """True if the bodies reproduce the base parameters."""
        return self.change <= _SAME


def states_of(target: IdentificationTarget, count: int = STATES) -> Samples:
    """Random states of the moving coordinates, within the limits."""
    return target.motion.states(random_states(target.robot, count, seed=1))


def nearest_bodies(
    target: IdentificationTarget, beta: Array, covariance: Array | None, known: Mapping[str, float]
) -> NearestBodies:
    """Physically consistent standard parameters nearest the robot's description."""  # beta (b,); covariance (b, b)
    bare = target.model.on(target.robot.replace(structure=Structure()))  # a column for every standard parameter
    samples = states_of(target)
    W_b = target.model.instants(samples)[:, target.base.index]
    definition, names = bare.definition()
    W = bare.instants(samples) @ definition
    theta = _standard(target, beta, triangular_factor(W_b), covariance, known)
    estimated = bool(known) and all(theta[name] == known.get(name) for name in theta)
    whole = np.array([theta.get(name, 0.0) for name in names])
    size = float(np.linalg.norm(W_b @ beta)) or 1.0
    return NearestBodies(
        theta,
        float(np.linalg.norm(W @ whole - W_b @ beta)) / size,
        dict(zip(names, (np.linalg.norm(W, axis=0) * np.abs(whole) / size).tolist(), strict=True)),
        estimated,
    )


def _standard(
    target: IdentificationTarget, beta: Array, R: Array, covariance: Array | None, known: Mapping[str, float]
) -> dict[str, float]:
    plain = problem_of_factor(R, R @ beta, target.model, target.base)
    plain = replace(plain, deviation=_CLOSE * plain.scale)
    theta, exact = nearest_possible(plain, shares=_SHARES)
    given = np.array([known.get(name, np.nan) for name in plain.names])
    if exact:
        refined = _refined(plain, theta, beta)
        theta = refined if _possible(plain, refined) else theta
    elif np.all(np.isfinite(given)) and _possible(plain, given) and _misfit(plain, given) <= _SAME:
        theta = given
    else:
        theta = _with_own_friction(target, plain, _nearest_in_noise(target, beta, R, covariance), beta)
    return dict(zip(plain.names, theta.tolist(), strict=True))


def _nearest_in_noise(target: IdentificationTarget, beta: Array, R: Array, covariance: Array | None) -> Array:
    """Possible parameters whose base parameters differ least from those given, in units of their uncertainty."""
    plain = R / (_NOISE * float(np.linalg.norm(R @ beta)) / np.sqrt(len(R)) or 1.0)
    for weights in (_weights(covariance), plain):
        if weights is not None:
            problem = problem_of_factor(weights, weights @ beta, target.model, target.base)
            with suppress(ConicSolverError):
                return nearest_possible(problem)[0]
    return nearest_possible(problem)[0]


def _with_own_friction(target: IdentificationTarget, problem: StandardProblem, theta: Array, beta: Array) -> Array:
    """Take friction as it was identified, where it is a base parameter on its own and possible."""
    theta = theta.copy()
    for row, value in zip(problem.A, beta, strict=True):
        used = np.flatnonzero(row)
        if used.size == 1 and target.model.standard_columns[used[0]].group == "friction":
            own = value / row[k := used[0]]
            theta[k] = max(own, 0.0) if k in problem.positive else own
    return theta


def _misfit(problem: StandardProblem, theta: Array) -> float:
    return float(np.linalg.norm(problem.G @ theta - problem.r) / np.linalg.norm(problem.r))


def _possible(problem: StandardProblem, theta: Array) -> bool:
    return bool(np.all(problem.margins(theta) > 0) and np.all(theta[problem.positive] >= 0))


def _refined(problem: StandardProblem, theta: Array, beta: Array) -> Array:
    """Remove what rounding has left of ``beta - A theta``, by the smallest change in the parameters' own sizes."""
    S = problem.S * problem.scale[:, None]
    change = np.linalg.lstsq(problem.A @ S, beta - problem.A @ theta, rcond=1e-13)[0]
    return np.asarray(theta + S @ change)


def _weights(covariance: Array | None) -> Array | None:
    """Triangular L with ``Sigma^-1 = L'L``; None where the covariance is not known or singular."""
    if covariance is None or not np.all(np.isfinite(covariance)):
        return None
    try:
        return np.asarray(scipy.linalg.inv(np.linalg.cholesky(covariance)))
    except np.linalg.LinAlgError:
        return None


_FLAT = 1e-5  # of the largest second moment of mass


def flat_bodies(bodies: Mapping[str, Array]) -> tuple[str, ...]:
    """Names of the bodies whose mass has almost no extent in some direction, as a sheet of 1 m by 3 mm."""
    flat = []
    for name, theta in bodies.items():
        J = pseudo_inertia(theta)
        if theta[0] > 0:
            # second moments of mass about the centre, ``J_xx - m c c'``
            moments = np.linalg.eigvalsh(J[:3, :3] - np.outer(J[:3, 3], J[:3, 3]) / J[3, 3])
            flat += [name] if moments[0] < _FLAT * moments[-1] else []
    return tuple(flat)


def flat_note(bodies: Mapping[str, Array]) -> tuple[str, ...]:
    """A note that names them; none where there are none."""
    note = (
        f"the identified parameters leave {', '.join(flat_bodies(bodies))} only just possible, as flat as a sheet or "
        "as thin as a rod: simulators may need shorter steps; an identification with `estimator='physical'` and "
        "`described_within=0.5` keeps all bodies near the description"
    )
    return (note,) if flat_bodies(bodies) else ()


_ROOM = 1e-6  # of the group's pseudo-inertia that the moving body must keep
_LISTED = 5
_PART = 0.5  # of the most that the others could have, where they are scaled


def own_part(group: Array, others: Sequence[tuple[Array, Array]]) -> tuple[Array, float]:
    """Parameters of the moving body, and the factor on those of the others.

    ``J_own = J_group - f sum_i T_i J_i T_i'`` with f = 1 or, where that leaves no possible body, ``1 / (2 lambda)``;
    lambda is the largest generalised eigenvalue of the others' pseudo-inertia and the group's.
    """  # group (10,); others (10,)
    J = pseudo_inertia(group)
    rest = sum((T @ pseudo_inertia(theta) @ T.T for theta, T in others), np.zeros((4, 4)))
    if not np.any(rest):
        return group, 1.0
    largest = float(scipy.linalg.eigh(rest, J, eigvals_only=True)[-1]) if np.linalg.eigvalsh(J)[0] > 0 else np.inf
    factor = 1.0 if largest <= 1.0 - _ROOM else _PART / largest
    return from_pseudo_inertia(J - factor * rest), factor


def held_note(link: str, others: Sequence[str], factor: float) -> str:
    """What to say of the bodies that moved with another one."""
    what = ": they keep the inertia of their description"
    if factor != 1.0:
        what = f", and their described inertia would leave it no possible one: they have {factor:.3g} of it"
    return f"{listed_names(others, _LISTED)} did not move against {link}{what}, and {link} has the rest"

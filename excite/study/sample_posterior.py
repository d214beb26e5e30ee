"""Samples of the robots that the data of a result allow, among physically possible ones."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy

from excite.identification.estimators.possible_set import StandardProblem, problem_of_factor
from excite.identification.identification import (
    Identification,
    stated_covariance,
    torque_target,
    unconstrained_estimate,
)
from excite.identification.result_json import load_result
from excite.information.target import IdentificationTarget
from excite.storage.manifest import sha256_of
from excite.study.chains import (
    CHAINS,
    PosteriorCoordinates,
    coordinates_inside,
    described_prior,
    draws,
    inner_point,
    path_count,
    posterior_coordinates,
)
from excite.study.posterior_samples import LEVEL, PosteriorSamples
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.models.nominal import standard_values
from regressors.numerical import numerical_work
from regressors.quantities import check
from regressors.robot.columns import BODY_KINDS
from regressors.samples import Array
from regressors.work_prediction import announce

SAMPLES, PRIOR = 1000, 0.3
_FEWEST = 4 * CHAINS  # draws that show whether the chains agree
_MIXED = 1.05
_SECONDS = 5e-6  # of a path, per body and per coordinate


@checked
@numerical_work("sampling the posterior", "identify again, from a motion that shows more of the parameters")
def sample_posterior(
    result: Identification | str | Path,
    samples: int = SAMPLES,
    *,
    seed: int = 0,
    prior: float = PRIOR,
    progress: Callable[[int, int], None] = lambda _, __: None,
) -> PosteriorSamples:
    """Draw possible robots that the data of a result allow.

    What the data determine is distributed as the result states it, ``beta ~ t(b, C, nu)`` with its covariance C, which
    allows for coloured noise and what else widens its intervals, and with its degrees of freedom; what they leave open
    as the description says, with a relative uncertainty. Of these robots only possible ones are drawn: all bodies have
    positive definite pseudo-inertias, at least 1e-3 of the described ones, all rotor inertias and coefficients of
    Coulomb and viscous friction are positive. The draws are of the exact distribution, by Hamiltonian Monte Carlo whose
    paths are reflected at what is impossible [Afshar, Domke 2015, Advances in Neural Information Processing Systems
    28], [Chalkis et al. 2023, ACM Transactions on Mathematical Software 49]; none is rejected for being impossible.

    Parameters
    ----------
    result : Identification or path
        Or the folder of a result.
    samples : int
        Number of robots.
    seed : int
        Sample k of a seed is the same however many are drawn.
    prior : float
        Relative standard deviation of what the robot's description states: of each mass, of each body's second moments
        of mass, 0.7 of it of each body's extent for the centre of mass, of each rotor inertia and coefficient of
        friction. Only what the data do not determine depends on it.
    progress : callable
        Called with the number of paths that are computed, and of all.

    Returns
    -------
    PosteriorSamples

    Raises
    ------
    InputError
        A result of a load, without a covariance, or of other parameters than its model's; numbers out of range.
    excite.errors.ConicSolverError
        No possible robot is near the identified one.
    """
    check("samples", samples)
    check("seed", seed)
    check("prior", prior)
    known = chosen_result(result)
    target = torque_target(known)
    standard, coordinates = posterior_of(known, target, prior)
    possible = coordinates_inside(standard, coordinates)
    start, closest = inner_point(possible)
    announce("sampling", _SECONDS * CHAINS * path_count(samples) * (3 + len(standard.bodies)) * coordinates.size)
    theta = coordinates.theta(draws(coordinates, possible, start, max(samples, _FEWEST), seed, progress))
    values = theta.reshape(-1, len(standard.names))[:samples]
    free = np.ptp(theta, axis=(0, 1)) > 0
    spread = float(split_deviation(theta[..., free]).max(initial=1.0))
    return PosteriorSamples(
        robot=known.robot.name,
        result_sha256=None if known.folder is None else sha256_of(known.folder / "result.json"),
        seed=seed,
        prior=float(prior),
        names=standard.names,
        units=tuple(column.unit for column in target.model.standard_columns),
        values=values,
        base_names=known.names,
        base_units=known.units,
        base_matrix=standard.A,
        distance=float(np.linalg.norm(closest)),
        effective=float(min(effective_draws(theta[..., free]).min(initial=np.inf), samples)),
        split_deviation=spread,
        notes=_notes(known, target, coordinates, closest, spread),
    )


def chosen_result(given: Identification | str | Path) -> Identification:
    """The result itself, or the one in a folder."""
    return load_result(given) if isinstance(given, str | Path) else given


def posterior_of(
    result: Identification, target: IdentificationTarget, relative: float
) -> tuple[StandardProblem, PosteriorCoordinates]:
    """The posterior without bounds, and the standard parameters that it is of."""
    covariance = stated_covariance(result)
    if covariance is None:
        raise InputError(f"{result.name} states no covariance of its parameters; identify again")
    mismatch = result.estimate.mismatch
    if mismatch is not None:
        covariance = covariance + mismatch
    beta = unconstrained_estimate(result)
    standard = problem_of_factor(np.eye(target.base.rank), beta, target.model, target.base)
    values = standard_values(target.robot)
    stated = frozenset(c.name for c in target.model.standard_columns if values.get(c.name) or c.kind in BODY_KINDS)
    prior = described_prior(standard, relative, stated & frozenset(values))
    freedom = float(max(result.estimate.degrees_of_freedom, 1))
    return standard, posterior_coordinates(standard, prior, beta, covariance, freedom)


def _notes(
    result: Identification,
    target: IdentificationTarget,
    coordinates: PosteriorCoordinates,
    closest: Array,
    spread: float,
) -> tuple[str, ...]:
    notes = []
    p = coordinates.determined
    own = float(np.linalg.norm(closest[:p]))
    bound = p * scipy.special.fdtri(p, coordinates.freedom, LEVEL)
    if own > np.sqrt(bound):
        notes.append(
            f"no possible robot is within the 99 % region of the estimate: the nearest is {own:.3g} deviations away, "
            f"where {np.sqrt(bound):.3g} are allowed for; all samples are near the bounds of what is possible"
        )
    if unseen := len(result.names) - p:
        notes.append(f"{unseen} parameters that the data do not determine are spread as the description says")
    if result.estimate.mismatch is not None:
        notes.append(
            "friction of the log differs over speed from what the model has: the samples allow for what that does to "
            "all parameters, which the intervals of the result do not count"
        )
    if without := [body.name for body in target.robot.bodies if body.theta is None]:
        notes.append(
            f"the description has no inertial parameters of {', '.join(without)}: what the data do not determine is "
            "spread by 100 % about a body of 1 kg with 0.02 kg m^2 about each axis"
        )
    if spread > _MIXED:
        notes.append(
            f"the samples are not independent enough (R = {spread:.3g} where 1.05 is usual): draw more, or identify "
            "from a motion that shows more of the parameters"
        )
    return tuple(notes)


def split_deviation(draws: Array) -> Array:
    """Potential scale reduction R of each parameter, of chains that are split in halves, shape (k,)."""
    # draws (rounds, chains, k)
    half = len(draws) // 2
    parts = np.concatenate([draws[:half], draws[half : 2 * half]], axis=1)
    within = parts.var(axis=0, ddof=1).mean(axis=0)
    between = half * parts.mean(axis=0).var(axis=0, ddof=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.sqrt(((half - 1) / half * within + between / half) / within)
    return np.asarray(np.where(within > 0, ratio, 1.0))


def effective_draws(draws: Array) -> Array:
    """Number of independent draws that say as much of each mean, shape (k,): by Geyer's positive sums."""
    # draws (rounds, chains, k)
    rounds, chains, _ = draws.shape
    centred = draws - draws.mean(axis=(0, 1))
    spectrum = np.fft.rfft(centred, 2 * rounds, axis=0)
    lagged = np.fft.irfft(np.abs(spectrum) ** 2, axis=0)[:rounds].mean(axis=1) / rounds
    with np.errstate(divide="ignore", invalid="ignore"):
        r = np.where(lagged[0] > 0, lagged / lagged[0], 0.0)
    pairs = r[1 : rounds - 1 : 2] + r[2:rounds:2]
    kept = np.cumprod(pairs > 0, axis=0)
    return np.asarray(rounds * chains / (1 + 2 * np.sum(pairs * kept, axis=0)))

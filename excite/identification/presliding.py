"""Velocity or distance over which Coulomb friction changes its direction, estimated from the data.

A measured velocity crosses zero late, early or twice, and a gear's friction does not jump; a direction that changes
smoothly then explains the torques better, as long as it does not blur real friction.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.optimize

from excite.identification.hysteresis import measured_direction
from excite.identification.known_friction import drive_rows, of_drives
from excite.identification.measured_regressor import DirectedFriction, friction_drives, put_friction
from excite.identification.observations import Observations
from excite.identification.preparation import PreparedLog
from excite.information.target import IdentificationTarget
from regressors.friction.curves import FrictionCurves
from regressors.models.base import triangular_factor
from regressors.samples import Array, Index, Samples

WIDTHS = 10.0 ** np.arange(-3.5, -0.4, 0.5)  # of the drives' typical speed
DISTANCES = 10.0 ** np.arange(-5.0, -1.9, 0.5)  # of the drives' typical travel
WORTH = 0.005  # gain in the mean logarithm of the residuals below which the exact sign stays
_ROWS = 10_000

Part = tuple[PreparedLog, Observations]
Score = Callable[[Sequence[Array]], float]


@dataclass(frozen=True)
class Presliding:
    """Sign change of Coulomb friction; the exact sign of the velocity where both parameters are zero.

    Parameters
    ----------
    sign_width : float
        w of ``tanh(dz / w)`` [rad/s or m/s].
    breakaway : float
        d of `measured_direction` [rad or m].
    """

    sign_width: float = 0.0
    breakaway: float = 0.0


def best_presliding(
    target: IdentificationTarget,
    parts: Sequence[Part],
    *,
    by_distance: bool = True,
    friction: FrictionCurves | None = None,
) -> Presliding:
    """Find the presliding of largest likelihood, each equation having its own noise.

    Parameters
    ----------
    target : IdentificationTarget
        With the exact sign.
    parts : sequence of (PreparedLog, Observations)
        Each log, and its equations at the same instants.
    by_distance : bool
        Whether presliding over a distance (Dahl) is tried too.
    friction : FrictionCurves, optional
        Known friction, not yet subtracted; the presliding is then that of the curves, not of the Coulomb columns.

    Returns
    -------
    Presliding
        The exact sign where nothing is clearly better, and for models without a friction torque at every instant.
    """
    exact, *found = presliding_candidates(target, parts, by_distance=by_distance, friction=friction)
    if not found:
        return Presliding()
    least = min(candidate.misfit for candidate in found)
    if exact.misfit - least <= WORTH:
        return Presliding()
    # the last, over a distance, if it explains the torques as well: it also holds at standstill, not shown by all logs
    return next(c.presliding for c in reversed(found) if c.misfit - least <= WORTH)


@dataclass(frozen=True)
class PreslidingCandidate:
    """A presliding, and how well it explains the data.

    Parameters
    ----------
    presliding : Presliding
    misfit : float
        Mean over the equations of the logarithm of the residuals' size.
    """

    presliding: Presliding
    misfit: float


def presliding_candidates(
    target: IdentificationTarget,
    parts: Sequence[Part],
    *,
    by_distance: bool = True,
    friction: FrictionCurves | None = None,
) -> list[PreslidingCandidate]:
    """The exact sign; and over a velocity, and over a distance, the presliding of largest likelihood.

    Parameters
    ----------
    target, parts, by_distance, friction
        See `best_presliding`.

    Returns
    -------
    list of PreslidingCandidate
        Only the exact sign where nothing moves, or the model has no friction torque at every instant.
    """
    if target.model.coulomb_friction() is None:
        return [PreslidingCandidate(Presliding(), 0.0)]
    score: Score
    every = max(1, sum(len(observations.y) for _, observations in parts) // _ROWS)
    if friction is None:
        drives = [friction_drives(target, part.samples) for part, _ in parts]
        paths, speeds = [d.z for d in drives], [d.dz for d in drives]
        score = _score_of_columns(parts, drives, every)
    else:
        C = drive_rows(target.robot)
        paths, speeds = ([getattr(part.samples, what) @ C.T for part, _ in parts] for what in ("q", "dq"))
        score = _score_of_curves(target, parts, friction, every)
    speed = _typical([np.sqrt(np.mean(dz**2, axis=0)) for dz in speeds])
    travel = _typical([np.std(z, axis=0) for z in paths])
    exact = PreslidingCandidate(Presliding(), score([np.sign(dz[::every]) for dz in speeds]))
    if not (speed > 0 and travel > 0):
        return [exact]
    thin = [dz[::every] for dz in speeds]
    families = [_Family("sign_width", speed * WIDTHS, lambda w: [np.tanh(dz / w) for dz in thin])]
    if by_distance:
        turning = [_turning(z, every) for z in paths]
        families.append(_Family("breakaway", travel * DISTANCES, lambda d: [_dahl(z, d) for z in turning]))
    return [exact, *(_refined(family, score) for family in families)]


@dataclass(frozen=True)
class _Family:
    """One kind of presliding: the grid of its parameter, and the directions of friction for each value."""

    kind: str
    sizes: Array
    directions: Callable[[float], list[Array]]


def _refined(family: _Family, score: Score) -> PreslidingCandidate:
    """Least misfit of a family and its parameter: on the grid, then refined between the neighbours."""

    def misfit(exponent: float) -> float:
        return score(family.directions(float(10.0**exponent)))

    exponents = np.log10(family.sizes)
    best = int(np.argmin([misfit(exponent) for exponent in exponents]))
    bounds = exponents[max(best - 1, 0)], exponents[min(best + 1, exponents.size - 1)]
    minimum = scipy.optimize.minimize_scalar(misfit, bounds=bounds, method="bounded", options={"xatol": 0.02})
    return PreslidingCandidate(Presliding(**{family.kind: float(10.0**minimum.x)}), float(minimum.fun))


def _dahl(path: Sequence[tuple[Array, Index]], distance: float) -> Array:
    """Directions of all drives, shape (N, k)."""
    return np.concatenate([measured_direction(z, distance)[place] for z, place in path], axis=1)


def _turning(z: Array, every: int) -> list[tuple[Array, Index]]:
    """Path of each drive at the decimated instants and where it turns, and the places of the former among both.

    Between two turns only the length of the path matters for `measured_direction`, also for the way that it begins.
    """
    paths = []
    for drive in z.T:
        way = np.sign(np.diff(drive))
        wanted = np.arange(0, drive.size, every)
        turns = np.flatnonzero(way[1:] != way[:-1]) + 1
        kept = np.unique(np.concatenate([wanted, turns, [drive.size - 1]]))
        paths.append((drive[kept, None], np.searchsorted(kept, wanted)))
    return paths


def _typical(sizes: Sequence[Array]) -> float:
    together = np.concatenate([size.ravel() for size in sizes])
    return float(np.median(together)) if together.size else 0.0


def _score_of_columns(parts: Sequence[Part], drives: Sequence[DirectedFriction], every: int) -> Score:
    """Misfit of friction directions if the magnitudes are identified along, on a subset of the rows."""
    columns, rows = drives[0].columns, drives[0].rows
    W, y = _thinned(parts, rows.shape[1], every)
    magnitudes = np.concatenate([d.magnitudes[::every] for d in drives])

    def score(directions: Sequence[Array]) -> float:
        put_friction(W, columns, np.concatenate(directions) * magnitudes, rows)
        return _misfit(W, y)

    return score


def _score_of_curves(
    target: IdentificationTarget, parts: Sequence[Part], friction: FrictionCurves, every: int
) -> Score:
    """Misfit of friction directions for known friction, on a subset of the rows."""
    model = target.model
    r = len(model.row_labels)
    W, _ = _thinned(parts, r, every)
    thinned = [_every(part, target, every) for part, _ in parts]

    def score(directions: Sequence[Array]) -> float:
        y = [
            model.right_side(m, friction.carried_torque(target.robot, m.q, m.dq, tau, s, T)).reshape(-1, r)
            for (m, tau, T), s in zip(thinned, directions, strict=True)
        ]
        return _misfit(W, np.concatenate(y))

    return score


def _every(part: PreparedLog, target: IdentificationTarget, every: int) -> tuple[Samples, Array, Array | None]:
    """Motion, torques and drive temperatures of a log, decimated."""
    drive_temperature = of_drives(target.robot, part.temperature)
    return (
        part.samples.rows(slice(None, None, every)),
        part.measured[::every],
        None if drive_temperature is None else drive_temperature[::every],
    )


def _thinned(parts: Sequence[Part], r: int, every: int) -> tuple[Array, Array]:
    """Decimated equations of all logs: the regressor (N, r, b), and the right-hand side (N, r)."""
    rows = [(np.arange(0, len(o.y), every * r)[:, None] + np.arange(r)).ravel() for _, o in parts]
    W, y = (np.concatenate([getattr(o, name)[k] for (_, o), k in zip(parts, rows, strict=True)]) for name in "Wy")
    return W.reshape(-1, r, W.shape[1]), y.reshape(-1, r)


def _misfit(W: Array, y: Array) -> float:
    """Mean over the equations of the logarithm of the residuals' size, after a fit weighted by these sizes."""
    factors = [triangular_factor(np.column_stack([W[:, j], y[:, j]])) for j in range(y.shape[1])]
    sizes = np.ones(len(factors))
    for _ in range(4):
        stacked = np.concatenate([R / s for R, s in zip(factors, sizes, strict=True)])
        beta = np.linalg.lstsq(stacked[:, :-1], stacked[:, -1], rcond=None)[0]
        sizes = np.array([np.linalg.norm(R[:, -1] - R[:, :-1] @ beta) for R in factors]) / np.sqrt(len(y))
        sizes = np.maximum(sizes, 1e-9 * np.sqrt(np.mean(y**2)))
    return float(np.mean(np.log(sizes)))

"""Velocity or distance over which Coulomb friction changes its direction, estimated from the data.

A measured velocity crosses zero late, early or twice, and a gear's friction does not jump; a direction that changes
smoothly then explains the torques better, as long as it does not blur real friction.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.optimize

from excite.identification.equations import DirectedFriction, friction_drives, put_friction
from excite.identification.friction_directions import directions, drive_rows
from excite.identification.hysteresis import measured_direction
from excite.identification.known_friction import of_drives
from excite.identification.observations import Observations
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Sizes
from excite.information.target import IdentificationTarget
from regressors.friction.curves import FrictionCurves
from regressors.models.base import triangular_factor
from regressors.samples import Array, Samples

WIDTHS = 10.0 ** np.arange(-3.5, -0.4, 0.5)  # of the drives' typical speed
DISTANCES = 10.0 ** np.arange(-5.0, -1.9, 0.5)  # of the drives' typical travel
CLOSE = 1e-3  # of log10 of a size: the search then adds nothing to the scatter by noise, which 2e-2 doubled
WORTH = 0.005  # gain in the mean logarithm of the residuals below which the exact sign stays
_ROWS = 10_000

Part = tuple[PreparedLog, Observations]
Score = Callable[[Sequence[Array]], float]


@dataclass(frozen=True)
class Presliding:
    """Sign change of Coulomb friction; the exact sign of the velocity where both parameters are zero."""

    sign_width: float = 0.0  # w of ``tanh(dz / w)`` [rad/s or m/s]
    breakaway: float = 0.0  # d of `measured_direction` [rad or m]


def best_presliding(
    target: IdentificationTarget,
    parts: Sequence[Part],
    *,
    by_distance: bool = True,
    friction: FrictionCurves | None = None,
) -> Presliding:
    """Find the presliding of largest likelihood, each equation having its own noise."""
    exact, *found = presliding_candidates(target, parts, by_distance=by_distance, friction=friction)
    if not found:
        return Presliding()
    least = min(candidate.misfit for candidate in found)
    if exact.misfit - least <= WORTH:
        return Presliding()
    # the last, over a distance, if it explains as much: it also holds at standstill, which logs may not show
    return next(c.presliding for c in reversed(found) if c.misfit - least <= WORTH)


@dataclass(frozen=True)
class PreslidingCandidate:
    """A presliding, and how well it explains the data."""

    presliding: Presliding
    misfit: float  # mean over the equations of the logarithm of the residuals' size


def presliding_candidates(
    target: IdentificationTarget,
    parts: Sequence[Part],
    *,
    by_distance: bool = True,
    friction: FrictionCurves | None = None,
) -> list[PreslidingCandidate]:
    """The exact sign; and over a velocity, and over a distance, the presliding of largest likelihood."""
    if target.model.coulomb_friction() is None:
        return [PreslidingCandidate(Presliding(), 0.0)]
    score, used = _score_of_drives(target, parts, friction)
    paths, speeds = _drive_motions(target, parts)
    speed = _typical([np.sqrt(np.mean(dz[:, used] ** 2, axis=0)) for dz in speeds])
    travel = _typical([np.std(z[:, used], axis=0) for z in paths])
    exact = PreslidingCandidate(Presliding(), score([np.sign(dz) for dz in speeds]))
    if not (speed > 0 and travel > 0):
        return [exact]
    families = [_Family("sign_width", speed * WIDTHS, lambda w: [np.tanh(dz / w) for dz in speeds])]
    if by_distance:
        families.append(_Family("breakaway", travel * DISTANCES, lambda d: [measured_direction(z, d) for z in paths]))
    return [exact, *(_refined(family, score) for family in families)]


def presliding_of_each(
    target: IdentificationTarget,
    parts: Sequence[Part],
    common: Presliding,
    *,
    friction: FrictionCurves | None = None,
) -> tuple[float, ...]:
    """Find the size of the presliding of each drive, from one for all, one drive after the other."""
    by_distance = common.breakaway > 0
    score, used = _score_of_drives(target, parts, friction)
    paths, speeds = _drive_motions(target, parts)

    def misfit(given: Array) -> float:
        each = (None, tuple(given.tolist())) if by_distance else (tuple(given.tolist()), None)
        return score([_directions(z, dz, each) for z, dz in zip(paths, speeds, strict=True)])

    drives = np.arange(paths[0].shape[1])
    given = np.full(drives.size, common.breakaway if by_distance else common.sign_width)
    speed, travel = (_typical([np.std(x[:, used], axis=0) for x in motion]) for motion in (speeds, paths))
    grid = travel * DISTANCES if by_distance else speed * WIDTHS
    least = misfit(given)
    for k in used:
        trials = [np.where(drives == k, size, given) for size in (0.0, *grid)]
        scores = [misfit(trial) for trial in trials]
        if least - min(scores) > WORTH:
            least, given = min(scores), trials[int(np.argmin(scores))]
    return tuple(given.tolist())


def _directions(z: Array, dz: Array, each: tuple[Sizes | None, Sizes | None]) -> Array:
    found = directions(z, dz, *each)
    return np.sign(dz) if found is None else found


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
    minimum = scipy.optimize.minimize_scalar(misfit, bounds=bounds, method="bounded", options={"xatol": CLOSE})
    return PreslidingCandidate(Presliding(**{family.kind: float(10.0**minimum.x)}), float(minimum.fun))


def _typical(sizes: Sequence[Array]) -> float:
    together = np.concatenate([size.ravel() for size in sizes])
    return float(np.median(together)) if together.size else 0.0


def _drive_motions(target: IdentificationTarget, parts: Sequence[Part]) -> tuple[list[Array], list[Array]]:
    """Coordinates of the moving drives, up to constants, and their velocities, in each log."""
    C = drive_rows(target.robot)
    return [part.samples.q @ C.T for part, _ in parts], [part.samples.dq @ C.T for part, _ in parts]


def _score_of_drives(
    target: IdentificationTarget, parts: Sequence[Part], friction: FrictionCurves | None
) -> tuple[Score, list[int]]:
    """Misfit of friction directions of all moving drives, and the places of those drives that it depends on."""
    drives = [friction_drives(target, part.samples) for part, _ in parts]
    if friction is None:
        return _score_of_columns(parts, drives), sorted(set(drives[0].drives))
    return _score_of_curves(target, parts, drives, friction), list(range(len(drive_rows(target.robot))))


def _score_of_columns(parts: Sequence[Part], drives: Sequence[DirectedFriction]) -> Score:
    """Misfit of friction directions if the magnitudes are identified along, on a subset of the rows."""
    every = _step(parts)
    W, y = _thinned(parts, drives[0].rows.shape[1], every)

    def score(directions: Sequence[Array]) -> float:
        _put(W, drives, directions, every)
        return _misfit(W, y)

    return score


def _score_of_curves(
    target: IdentificationTarget, parts: Sequence[Part], drives: Sequence[DirectedFriction], friction: FrictionCurves
) -> Score:
    """Misfit of friction directions for curves, and for the columns of other drives, on a subset of the rows."""
    model = target.model
    r = len(model.row_labels)
    every = _step(parts)
    W, _ = _thinned(parts, r, every)
    thinned = [_every(part, target, every) for part, _ in parts]

    def score(directions: Sequence[Array]) -> float:
        _put(W, drives, directions, every)
        y = [
            model.right_side(m, friction.carried_torque(target.robot, m.q, m.dq, tau, s[::every], T)).reshape(-1, r)
            for (m, tau, T), s in zip(thinned, directions, strict=True)
        ]
        return _misfit(W, np.concatenate(y))

    return score


def _put(W: Array, drives: Sequence[DirectedFriction], directions: Sequence[Array], every: int) -> None:
    """Write the friction of every log into its columns of the decimated regressor, in place."""
    torque = [s[::every, list(d.drives)] * d.magnitudes[::every] for d, s in zip(drives, directions, strict=True)]
    put_friction(W, drives[0].columns, np.concatenate(torque), drives[0].rows)


def _every(part: PreparedLog, target: IdentificationTarget, every: int) -> tuple[Samples, Array, Array | None]:
    """Motion, torques and drive temperatures of a log, decimated."""
    drive_temperature = of_drives(target.robot, part.temperature)
    return (
        part.samples.rows(slice(None, None, every)),
        part.measured[::every],
        None if drive_temperature is None else drive_temperature[::every],
    )


def _step(parts: Sequence[Part]) -> int:
    """Decimation of the rows."""
    return max(1, sum(len(observations.y) for _, observations in parts) // _ROWS)


def _thinned(parts: Sequence[Part], r: int, every: int) -> tuple[Array, Array]:
    """Decimated equations of all logs: the regressor (N, r, b), and the right-hand side (N, r)."""
    rows = [(np.arange(0, len(o.y), every * r)[:, None] + np.arange(r)).ravel() for _, o in parts]
    W, y = (np.concatenate([getattr(o, name)[k] for (_, o), k in zip(parts, rows, strict=True)]) for name in "Wy")
    return W.reshape(-1, r, W.shape[1]), y.reshape(-1, r)


def _misfit(W: Array, y: Array) -> float:
    """Mean over the equations of the logarithm of the residuals' size, after a fit weighted by these sizes."""
    factors = [_factor(W[:, j], y[:, j]) for j in range(y.shape[1])]
    sizes = np.ones(len(factors))
    for _ in range(4):
        stacked = np.concatenate([R / s for R, s in zip(factors, sizes, strict=True)])
        beta = np.linalg.lstsq(stacked[:, :-1], stacked[:, -1], rcond=None)[0]
        sizes = np.array([np.linalg.norm(R[:, -1] - R[:, :-1] @ beta) for R in factors]) / np.sqrt(len(y))
        sizes = np.maximum(sizes, 1e-9 * np.sqrt(np.mean(y**2)))
    return float(np.mean(np.log(sizes)))


def _factor(W: Array, y: Array) -> Array:
    """Factor R of ``[W y] = QR``, in which columns of zeros stay so."""
    used = np.append(np.flatnonzero(np.einsum("np,np->p", W, W)), W.shape[1])
    R = triangular_factor(np.column_stack([W, y])[:, used])
    whole = np.zeros((len(R), W.shape[1] + 1))
    whole[:, used] = R
    return whole

"""Doubt where base parameters have values that no set of bodies and drives has."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.stats

from excite.identification.estimate import CONFIDENCE, Estimate
from excite.identification.plausibility.doubt import Doubt
from excite.identification.plausibility.residual_causes import NoisyDerivatives
from regressors.models.base import Base
from regressors.models.columns import BODY_KINDS, COULOMB, ROTOR, VISCOUS
from regressors.samples import Array

_NAMED = 4
_NEGLIGIBLE = 0.01  # of the torques
_ROUNDING = 1e-9
_PARTS = 10


def signs_of_bodies(base: Base) -> Array:
    """Sign that each base parameter has for every possible set of bodies and drives, shape (b,): 1, -1 or 0.

    A base parameter is ``sum_b tr(A_b J_b)`` over the pseudo-inertias J_b of the bodies, which are positive
    semi-definite [Wensing et al. 2018], plus rotor inertias and friction, which are not negative. It has one sign if
    all A_b are semi-definite of that sign; 0 where it may have either.
    """
    owners: dict[object, list[int]] = {}
    for j, column in enumerate(base.columns):
        if column.kind in BODY_KINDS:
            owners.setdefault(column.owner, []).append(j)
    bodies = [columns for columns in owners.values() if len(columns) == _PARTS]
    drives = [j for j, column in enumerate(base.columns) if column.kind in (ROTOR, COULOMB, VISCOUS)]
    placed = {*drives, *(j for columns in bodies for j in columns)}
    free = [j for j in range(len(base.columns)) if j not in placed]
    D = np.where(np.abs(base.D) > _ROUNDING * np.abs(base.D).max(axis=1, keepdims=True), base.D, 0.0)
    eigenvalues = [np.linalg.eigvalsh(_dual(D[:, columns])) for columns in bodies]
    values = np.concatenate([D[:, drives], *eigenvalues], axis=1)
    tolerance = _ROUNDING * np.abs(values).max(axis=1, initial=0.0)
    either = np.any(D[:, free] != 0.0, axis=1) | ~np.any(values != 0.0, axis=1)
    least, most = values.min(axis=1, initial=0.0), values.max(axis=1, initial=0.0)
    sign = np.where(least >= -tolerance, 1.0, np.where(most <= tolerance, -1.0, 0.0))
    return np.where(either, 0.0, sign)


def _dual(c: Array) -> Array:
    """``A`` with ``tr(A J) = c . theta`` for the pseudo-inertia ``J = [[S, h], [h', m]]``, shape (b, 4, 4).

    ``S = tr(I) / 2 - I``, hence ``Ixx = Syy + Szz`` and ``Ixy = -Sxy``.
    """
    m, hx, hy, hz, xx, xy, xz, yy, yz, zz = c.T
    return np.moveaxis(
        np.array(
            [
                [yy + zz, -xy / 2, -xz / 2, hx / 2],
                [-xy / 2, xx + zz, -yz / 2, hy / 2],
                [-xz / 2, -yz / 2, xx + yy, hz / 2],
                [hx / 2, hy / 2, hz / 2, m],
            ]
        ),
        -1,
        0,
    )


def impossible_parameters(estimate: Estimate, base: Base, shares: Array, noise: NoisyDerivatives) -> Doubt | None:
    """Doubt where the sign of base parameters is beyond their intervals that of no body and no drive.

    The intervals hold for all tested parameters at once with 99 % (Bonferroni). Parameters that make less than 1 % of
    the torques are not tested.
    """  # shares (b,)
    sign = np.where(shares > _NEGLIGIBLE, signs_of_bodies(base), 0.0)
    tested = max(int(np.count_nonzero(sign)), 1)
    half = scipy.stats.t.ppf(1 - (1 - CONFIDENCE) / (2 * tested), max(estimate.degrees_of_freedom, 1))
    half = half * estimate.deviation
    with np.errstate(invalid="ignore"):
        beyond = np.flatnonzero(sign * estimate.values + half < 0)
    if not beyond.size:
        return None
    order = beyond[np.argsort((sign * estimate.values / np.where(half > 0, half, 1.0))[beyond])]
    shown = [
        f"{estimate.names[j]} = {estimate.values[j]:.3g} +- {half[j]:.2g} {estimate.units[j]}" for j in order[:_NAMED]
    ]
    more = f" and {len(order) - _NAMED} more" if len(order) > _NAMED else ""
    kinds = {base.columns[base.index[j]].kind for j in order}
    what = f"no body and no drive has {', '.join(shown)}{more}, whose sign is wrong beyond the 99 % interval"
    if noise.cause is not None:
        return Doubt(what, *noise.cause)
    return Doubt(
        what,
        _cause(kinds),
        "check the signs and units in the mapping, or admit only possible parameters with `estimator='physical'`",
    )


def _cause(kinds: set[str]) -> str:
    if kinds <= {COULOMB, VISCOUS}:
        return "friction that drives a joint means a torque of the wrong sign, or friction that the model lacks"
    if kinds <= {ROTOR}:
        return "the inertia of the drives takes up what the model lacks, or the accelerations are wrong"
    return "the model lacks something that the torques have, or signs or units are wrong"


def heavier_than_described(identified: Array, described: Array, most: float = 100.0) -> Doubt | None:
    """Doubt where the torques of gravity are those of masses over 100 times the described ones."""
    # identified, described (N, r)
    size = float(np.linalg.norm(described))
    ratio = float(np.linalg.norm(identified)) / size if size > 0 else 0.0
    if not ratio > most:
        return None
    return Doubt(
        f"the bodies are {ratio:.3g} times as heavy as the robot's description states",
        "torques in another unit, or those of a motor taken for those of its joint, look like that",
        "check the unit, gain and ratio of the torques in the mapping",
    )


def described_coefficients(base: Base, known: Mapping[str, float]) -> Array | None:
    """Base parameters of the described bodies, unknown friction and rotors as zero; None where a body is unknown."""
    bodies = [column for column in base.columns if column.kind in BODY_KINDS]
    if not bodies or any(column.name not in known for column in bodies):
        return None
    return np.asarray(base.D @ np.array([known.get(column.name, 0.0) for column in base.columns]))

"""What friction that the model does not have does to an estimate, as one log shows it.

The model's friction is a few terms per drive; real friction is a curve over speed. What the curve has beside the terms
is written as bumps, ``g_k = exp(-(dz / v_k)^2) s`` with the direction of motion s, at three speeds v_k of each drive's
fastest. With them the equations are ``y = W beta + G c``, whose solution differs from the model's by
``d = -(W'VW)^-1 W'VG c``. Where c is more than noise explains, the model fails there, and the error of the estimate has
about the second moments

    d d' + (W'VW)^-1 W'VG Cov(c) G'VW (W'VW)^-1

beside the covariance for noise [Hausman 1978, Econometrica 46, 1251], with the covariance of c by the residuals that
the bumps leave, which are the noise's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.linalg
import scipy.stats
from numpy.typing import NDArray

from excite.identification.covariance import METHODS, divisors, with_covariance
from excite.identification.equations import friction_drives, kept_rows
from excite.identification.estimate import Estimate
from excite.identification.estimator import Context
from excite.identification.estimators.weighted import weighted
from excite.identification.friction_directions import drive_directions, drive_rows
from excite.identification.observations import Observations
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.identification.streamed_rows import StreamedRows
from excite.information.target import IdentificationTarget
from regressors.samples import Array

SPEEDS = (0.05, 0.15, 0.45)  # of each drive's fastest
_CHANCE = 1e-3  # of noise alone being taken for a mismatch
_SHOWN = 1e-6  # of a bump's length that neither the model nor the other bumps explain


def friction_mismatch(estimate: Estimate, observations: Observations, context: Context) -> Array | None:
    """Second moments of the error that friction of other forms causes, shape (p, p)."""
    if estimate.method not in METHODS or isinstance(observations.W, StreamedRows):
        return None
    model, base = context.target.model, context.target.base
    friction = model.coulomb_friction()
    if model.window is not None or friction is None or not np.isin(friction.columns, base.index).any():
        return None
    seen = np.isfinite(np.diag(estimate.covariance))
    G = bumps(context.target, context.prepared, context.recipe)
    G, reach = _directions(observations.W[:, seen], G, 1 / divisors(estimate)[observations.group])
    wider = _with_columns(observations, seen, G)
    other = with_covariance(weighted(wider), wider, context.recipe.covariance)
    rank, c, C = G.shape[1], other.values[-G.shape[1] :], other.covariance[-G.shape[1] :, -G.shape[1] :]
    if not rank or not np.all(np.isfinite(C)):
        return None
    bound = rank * scipy.stats.f.isf(_CHANCE, rank, max(other.degrees_of_freedom, 1))
    if c @ np.linalg.solve(C, c) <= bound:
        return None
    moments = np.zeros_like(estimate.covariance)
    moments[np.ix_(seen, seen)] = np.outer(reach @ c, reach @ c) + reach @ C @ reach.T
    return moments


def bumps(target: IdentificationTarget, parts: Sequence[PreparedLog], recipe: Recipe) -> Array:
    """Torque of every bump of every drive in the equations, shape (m, k)."""
    C = drive_rows(target.robot)
    fastest = np.max([np.abs(part.samples.dq @ C.T).max(axis=0) for part in parts], axis=0)
    return np.concatenate([_of_log(target, part, recipe, fastest) for part in parts])


def _of_log(target: IdentificationTarget, part: PreparedLog, recipe: Recipe, fastest: Array) -> Array:
    samples = part.samples
    friction, speed = friction_drives(target, samples), samples.dq @ drive_rows(target.robot).T
    direction = drive_directions(target.robot, samples, recipe.sign_width, recipe.breakaway)
    s = np.sign(speed) if direction is None else direction
    columns = []
    for drive, row in dict(zip(friction.drives, friction.rows, strict=True)).items():
        for share in SPEEDS:
            torque = s[:, drive] * np.exp(-((speed[:, drive] / (share * (fastest[drive] or 1.0))) ** 2))
            columns.append(kept_rows(target, part, recipe, (torque[:, None] * row).reshape(-1, 1))[:, 0])
    return np.column_stack(columns)


def _directions(W: Array, G: Array, weight: Array) -> tuple[Array, Array]:
    """Sums of bumps that neither the parameters nor each other explain, shape (m, k), and what each does to beta."""
    Q, R = np.linalg.qr(W * weight[:, None])
    size = np.linalg.norm(G * weight[:, None], axis=0)
    G = G / np.where(size > 0, size, 1.0)
    B = Q.T @ (G * weight[:, None])
    _, s, V = np.linalg.svd(G * weight[:, None] - Q @ B, full_matrices=False)
    sums = V[s > _SHOWN].T / s[s > _SHOWN]
    return G @ sums, -np.asarray(scipy.linalg.solve_triangular(R, B @ sums))


def _with_columns(observations: Observations, seen: NDArray[np.bool_], G: Array) -> Observations:
    """The observations with the parameters that are seen, and one more for each column."""
    number = range(1, G.shape[1] + 1)
    return replace(
        observations,
        W=np.hstack([observations.matrix[:, seen], G]),
        names=(*(n for n, s in zip(observations.names, seen, strict=True) if s), *(f"bumps {k}" for k in number)),
        units=(*(u for u, s in zip(observations.units, seen, strict=True) if s), *("Nm" for _ in number)),
    )

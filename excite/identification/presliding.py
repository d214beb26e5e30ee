"""Velocity or distance over which Coulomb friction changes its direction, estimated from the data.

A measured velocity crosses zero late, early or twice, and a gear's friction does not jump; a direction that changes
smoothly then explains the torques better, as long as it does not blur real friction.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy

from excite.identification.choices.left_out import least_squares_of_products, weighted_sum
from excite.identification.equations import (
    DirectedFriction,
    friction_drives,
    listed,
    measured_direction,
    sample_way,
    streamed_equations,
)
from excite.identification.observations import Observations
from excite.identification.prediction import of_drives
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from excite.tasks.task import Task
from regressors.models.base import triangular_factor
from regressors.robot.columns import COULOMB
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.friction.load_and_temperature import friction_rows
from regressors.samples import Array, Index, Samples

WIDTHS = 10.0 ** np.arange(-3.5, -0.4, 0.5)  # of the drives' typical speed
DISTANCES = 10.0 ** np.arange(-5.0, -1.9, 0.5)  # of the drives' typical travel
CLOSE = 1e-3  # of log10 of a size: the search then adds nothing to the scatter by noise, which 2e-2 doubled
WORTH = 0.005  # gain in the mean logarithm of the residuals below which the exact sign stays
_ROWS = 10_000

Score = Callable[[Sequence[Array]], float]
# of a recipe: w of ``tanh(dz / w)`` [rad/s or m/s], d of `measured_direction` [rad or m]; zeros for the exact sign
Sliding = dict[str, Any]
_EXACT: Sliding = {"sign_width": 0.0, "breakaway": 0.0}


def presliding_candidates(
    recipe: Recipe, target: IdentificationTarget, parts: Sequence[PreparedLog], friction: FrictionCurves | None = None
) -> list[tuple[Sliding, float]]:
    """The exact sign; and over a velocity, and over a distance if not given, the presliding of largest likelihood.

    Each with its misfit, the mean over the equations of the logarithm of the residuals' size.
    """
    if target.model.coulomb_friction() is None:
        return [(_EXACT, 0.0)]
    plain = replace(recipe, low_pass=None, every=None, sign_width=0.0, breakaway=0.0)
    # friction remembers every row, those too that make no equations later
    equations = [streamed_equations(target, replace(part, left_out=()), plain) for part in parts]
    drives = [friction_drives(target, part.samples) for part in parts]
    C = friction_rows(target.robot)
    used = sorted(set(drives[0].drives)) if friction is None else list(range(len(C)))
    score = _score(target, parts, equations, drives, friction)
    paths, speeds = ([getattr(part.samples, name) @ C.T for part in parts] for name in ("q", "dq"))
    speed = _typical([np.sqrt(np.mean(dz[:, used] ** 2, axis=0)) for dz in speeds])
    travel = _typical([np.std(z[:, used], axis=0) for z in paths])
    found = [(_EXACT, score([np.sign(dz) for dz in speeds]))]
    if speed > 0 and travel > 0:
        width, misfit = _refined(speed * WIDTHS, lambda w: score([np.tanh(dz / w) for dz in speeds]))
        found.append(({**_EXACT, "sign_width": width}, misfit))
        if recipe.breakaway is None:
            paces = [sample_way(part.samples) @ C.T for part in parts]
            turned = list(zip(paths, paces, strict=True))
            distance, misfit = _refined(
                travel * DISTANCES, lambda d: score([measured_direction(z, d, pace) for z, pace in turned])
            )
            found.append(({**_EXACT, "breakaway": distance}, misfit))
    return found


def _refined(sizes: Array, score: Callable[[float], float]) -> tuple[float, float]:
    """Size of the least misfit, and that misfit: on a grid, then refined between the neighbours."""

    def misfit(exponent: float) -> float:
        return score(float(10.0**exponent))

    exponents = np.log10(sizes)
    best = int(np.argmin([misfit(exponent) for exponent in exponents]))
    bounds = exponents[max(best - 1, 0)], exponents[min(best + 1, exponents.size - 1)]
    minimum = scipy.optimize.minimize_scalar(misfit, bounds=bounds, method="bounded", options={"xatol": CLOSE})
    return float(10.0**minimum.x), float(minimum.fun)


def _typical(sizes: Sequence[Array]) -> float:
    together = np.concatenate([size.ravel() for size in sizes])
    return float(np.median(together)) if together.size else 0.0


def _score(
    target: IdentificationTarget,
    parts: Sequence[PreparedLog],
    equations: Sequence[Observations],
    drives: Sequence[DirectedFriction],
    friction: FrictionCurves | None,
) -> Score:
    """Misfit of friction directions, on a subset of the rows: of columns whose magnitudes are identified, or of curves.

    The columns of drives without a curve are identified along with curves.
    """
    model, r = target.model, len(target.model.row_labels)
    every = max(1, sum(len(one.y) for one in equations) // _ROWS)
    rows = [(np.arange(0, len(one.y), every * r)[:, None] + np.arange(r)).ravel() for one in equations]
    W, y = (np.concatenate([getattr(o, name)[k] for o, k in zip(equations, rows, strict=True)]) for name in "Wy")
    W, y = W.reshape(-1, r, W.shape[1]), y.reshape(-1, r)
    columns, coupling = np.array(drives[0].columns, dtype=np.intp), drives[0].rows
    directed = [np.unique(columns[coupling[:, j] != 0.0]) for j in range(r)]
    factors = [_factored(W[:, j], own) for j, own in enumerate(directed)]
    thinned = [] if friction is None else [_every(part, target, every) for part in parts]

    def score(directions: Sequence[Array]) -> float:
        """Of the directions of every log's drives, which are those of the friction columns."""
        moved = [s[::every, list(d.drives)] * d.magnitudes[::every] for d, s in zip(drives, directions, strict=True)]
        torque, right = np.concatenate(moved), y
        if friction is not None:
            carried = [
                model.right_side(m, friction.carried_torque(target.robot, m.q, m.dq, tau, s[::every], T)).reshape(-1, r)
                for (m, tau, T), s in zip(thinned, directions, strict=True)
            ]
            right = np.concatenate(carried)
        # drives that share a column add up in it
        own = [torque @ (coupling[:, j, None] * (columns[:, None] == used)) for j, used in enumerate(directed)]
        return _misfit([factor(*pair) for factor, *pair in zip(factors, own, right.T, strict=True)], right)

    return score


def _every(part: PreparedLog, target: IdentificationTarget, every: int) -> tuple[Samples, Array, Array | None]:
    """Motion, torques and drive temperatures of a log, decimated."""
    temperature = of_drives(target.robot, None if part.temperature is None else part.temperature[::every])
    return part.samples.rows(slice(None, None, every)), part.measured[::every], temperature


def _misfit(factors: Sequence[Array], y: Array) -> float:
    """Mean over the equations of the logarithm of the residuals' size, after a fit weighted by these sizes."""
    sizes, products = np.ones(len(factors)), np.array([R.T @ R for R in factors])
    for _ in range(4):
        beta = least_squares_of_products(weighted_sum(products, sizes**-2))
        sizes = np.array([np.linalg.norm(R[:, -1] - R[:, :-1] @ beta) for R in factors]) / np.sqrt(len(y))
        sizes = np.maximum(sizes, 1e-9 * np.sqrt(np.mean(y**2)))
    return float(np.mean(np.log(sizes)))


def _factored(W: Array, directed: Index) -> Callable[[Array, Array], Array]:
    """Factor R of ``[W y] = QR`` of one equation for any friction, shape (N, m), and y; columns of zeros stay so."""
    # W (N, p); directed (m,) columns of friction. The others are factored once
    fixed = np.setdiff1d(np.flatnonzero(np.einsum("np,np->p", W, W)), directed)
    Q, R = np.linalg.qr(W[:, fixed])

    def factor(torque: Array, y: Array) -> Array:
        both = np.column_stack([torque, y])
        along = Q.T @ both
        beside = triangular_factor(both - Q @ along)
        whole = np.zeros((len(along) + len(beside), W.shape[1] + 1))
        whole[: len(along), fixed] = R
        whole[:, [*directed, -1]] = np.concatenate([along, beside])
        return whole

    return factor


def with_whole_window(task: Task, target: IdentificationTarget, part: PreparedLog) -> Task:
    """Round the length of a task's short windows to a whole number of samples."""
    window, time = target.model.window, part.samples.time
    if window is None or window.kind != "short":
        return task
    fitted = window.fitted(float(time[-1] - time[0]) / (time.size - 1))
    return task.changed(model=task.model.with_window(fitted))


def with_presliding(
    recipe: Recipe, target: IdentificationTarget, parts: Sequence[PreparedLog], friction: FrictionCurves | None
) -> Recipe:
    """Complete a recipe with the presliding of friction that fits the data best, where it is not given."""
    if recipe.sign_width is not None or recipe.breakaway or target.model.window is not None:
        return replace(recipe, sign_width=recipe.sign_width or 0.0, breakaway=recipe.breakaway or 0.0)
    (exact, misfit), *found = presliding_candidates(recipe, target, parts, friction)
    least = min((one for _, one in found), default=misfit)
    if misfit - least <= WORTH:
        return replace(recipe, **exact)
    # the last, over a distance, if it explains as much: it also holds at standstill, which logs may not show
    return replace(recipe, **next(sliding for sliding, one in reversed(found) if one - least <= WORTH))


def presliding_note(recipe: Recipe, target: IdentificationTarget, *, known: bool) -> tuple[str, ...]:
    """Describe the presliding of friction, or the length of the windows."""
    base, window = target.base, target.model.window
    if window is not None:
        cumulated = "the noise of long windows is a cumulated sum, which the intervals include"
        return (cumulated if window.kind == "long" else f"windows of {1e3 * window.length:.4g} ms",)
    columns = any(base.columns[k].kind == COULOMB for k in base.index)
    if not known and not columns:
        return ()
    what = ("friction, known or not," if columns else "known friction") if known else "Coulomb friction"
    return (presliding_words(recipe, what),)


def presliding_words(recipe: Recipe, what: str = "Coulomb friction") -> str:
    """Describe how friction changes its direction."""
    if np.any(recipe.breakaway or 0.0):
        return f"{what} reverses over a travel of {listed(recipe.breakaway)} rad (or m), and holds at standstill"
    if np.any(recipe.sign_width or 0.0):
        return f"{what} reverses over {listed(recipe.sign_width)} rad/s (or m/s)"
    return f"{what} has the sign of the velocity"

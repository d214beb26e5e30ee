"""Choice between known friction as it is given, and times one fitted factor for each drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from excite.identification.choices.block_statistics import BlockStatistics
from excite.identification.choices.choice import Candidate, Choice
from excite.identification.choices.left_out import LeftOut, least_squares_of_products
from excite.identification.choices.scoring import Scoring
from excite.identification.friction_scale import friction_torques, scaled_curves
from excite.identification.known_instants import nearest
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from regressors.friction.curves import FrictionCurves
from regressors.samples import Array

_WORTH = 0.005  # of the score: below that the curves stay as they are given
_HIDDEN = 1e-3  # of a curve's torque: what the parameters must leave of it, if its factor is to be found
_WITHIN = 10.0  # largest factor, and its inverse the least


@dataclass(frozen=True, eq=False)
class ChosenScale:
    """Whether known friction is scaled."""

    recipe: Recipe
    # the curves with the factors that the trial instants ask for; as given where they are not scaled
    friction: FrictionCurves
    choices: tuple[Choice, ...]  # None where no moving drive has a curve


def choose_friction_scale(
    scoring: Scoring, recipe: Recipe, parts: Sequence[PreparedLog], friction: FrictionCurves
) -> ChosenScale:
    """Scale known friction where this predicts left-out torques better by more than a standard error, and 0.5 %."""
    names, statistics = _with_factors(scoring, recipe, parts, friction)
    if not names:
        return ChosenScale(recipe, friction, ())
    given = scoring.of(statistics.of_columns(range(scoring.target.base.rank)))
    fitted = scoring.of(statistics)
    listed = (Candidate(False, given.error, given.score), Candidate(True, fitted.error, fitted.score))
    factors = _factors(scoring, statistics, fitted, len(names))
    gain, deviation = fitted.gain_over(given)
    if factors is None or gain <= max(deviation, _WORTH):
        reason = (
            f"known friction is subtracted as given, which predicts left-out torques to {_percent(given)}; one fitted "
            f"factor for each curve does not predict them clearly better ({_percent(fitted)})"
        )
        return ChosenScale(recipe, friction, (Choice("friction_scale", False, listed, reason),))
    reason = (
        f"known friction is scaled by one fitted factor for each curve: left-out torques are then predicted to "
        f"{_percent(fitted)} instead of {_percent(given)}"
    )
    scaled = scaled_curves(friction, dict(zip(names, factors.tolist(), strict=True)))
    return ChosenScale(replace(recipe, friction_scale=True), scaled, (Choice("friction_scale", True, listed, reason),))


def _with_factors(
    scoring: Scoring, recipe: Recipe, parts: Sequence[PreparedLog], friction: FrictionCurves
) -> tuple[tuple[str, ...], BlockStatistics]:
    """Names of the drives with curves, and statistics with their friction as the last columns."""
    trial, target = scoring.trial, scoring.target
    equations = trial.equations(target, parts, recipe)
    names: tuple[str, ...] = ()
    W = []
    for part, time, (regressor, _) in zip(parts, trial.instants, equations, strict=True):
        names, torques = friction_torques(target, part, friction, recipe)
        rows = nearest(part.samples.time, time)
        samples = part.samples.rows(rows)
        columns = [target.model.right_side(samples, torque[rows]).reshape(rows.size, -1) for torque in torques]
        W.append(np.concatenate([regressor, *(column[:, :, None] for column in columns)], axis=2))
    return names, BlockStatistics.of(W, [right for _, right in equations], trial.blocks)


def _factors(scoring: Scoring, statistics: BlockStatistics, errors: LeftOut, count: int) -> Array | None:
    """Factors of the curves, or None where they are not determined, or are none of friction."""
    products, weights = statistics.total, errors.weights
    both = np.tensordot(weights, products, axes=1)[:-1, :-1]
    length = np.sqrt(np.diag(both))
    if np.any(length[-count:] == 0.0):
        return None
    length = np.where(length > 0.0, length, 1.0)
    left = 1.0 / np.diag(np.linalg.pinv(both / np.outer(length, length), hermitian=True))[-count:]
    estimate = scoring.estimate or least_squares_of_products
    factors = 1.0 + estimate(products, weights)[-count:]
    determined = np.all(left > _HIDDEN**2) and np.all((factors > 1.0 / _WITHIN) & (factors < _WITHIN))
    return factors if determined else None


def _percent(score: LeftOut) -> str:
    return f"{100 * score.error:.3g} %"

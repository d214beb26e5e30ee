"""Choice of the delay of torques, of all, of single joints or logs, and how Coulomb friction changes its direction."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from typing import Any

import numpy as np

from excite.identification.choices.delays import (
    BEYOND,
    BISQUARE,
    LEAST_GAIN,
    LONGEST,
    TURN,
    DelayLikelihood,
    choose_delay,
)
from excite.identification.choices.left_out import Choice, LeftOut, best_of, candidates_of
from excite.identification.choices.scoring import Delays, Scoring
from excite.identification.preparation import PreparedLog
from excite.identification.presliding import presliding_candidates, presliding_words
from excite.identification.recipe import Recipe
from regressors.errors import percent
from regressors.robot.friction.load_and_temperature import friction_rows
from regressors.samples import Array

Chosen = tuple[Recipe, tuple[Choice, ...]]


def delay_of(scoring: Scoring, along: DelayFit, *undelayed: Recipe) -> tuple[float, Choice]:
    """Delay of the torques of some logs, see `choose_delay`; friction is softened already."""

    def scored(delay: float) -> LeftOut:
        recipes = (along.at(delay), *(() if delay else undelayed))
        return min((scoring.of(scoring.statistics(one, delay)) for one in recipes), key=lambda one: one.score)

    def residuals(weights: Array, delay: float) -> list[Array]:
        return _residuals(scoring, along.at(delay), delay, weights)

    return choose_delay(scored, residuals, scoring.step(along.recipe), *along.delays.tolist())


def _residuals(scoring: Scoring, recipe: Recipe, delay: Delays, weights: Array) -> list[Array]:
    """Residuals of each equation under a delay, after the estimate with it."""  # weights (r,)
    equations = scoring.equations(recipe, delay)
    statistics = scoring.trial.statistics_of(equations, scoring.target.base.rank)
    beta = scoring.fitted(statistics, weights)
    masks = scoring.trial.rows or [np.ones(y.shape, dtype=bool) for _, y in equations]
    predicted = [np.column_stack([beta[place] @ entries for place, entries in W]) for W, _ in equations]
    e = np.concatenate([y - p for (_, y), p in zip(equations, predicted, strict=True)])
    used = np.concatenate(masks)
    return [column[rows] for column, rows in zip(e.T, used.T, strict=True)]


def _kind(recipe: Recipe) -> str:
    return "breakaway" if recipe.breakaway else "sign_width"


def _is_smooth(scoring: Scoring, recipe: Recipe) -> bool:
    """Whether friction takes some samples to change its direction, so that a delay changes it smoothly."""
    accelerations = [np.sqrt(np.mean(part.samples.ddq**2)) for part in scoring.parts(recipe)]
    way = scoring.step(recipe) ** (2 if recipe.breakaway else 1) * np.median(accelerations)
    return bool(np.any(np.atleast_1d(getattr(recipe, _kind(recipe))) > way))


def _resized(recipe: Recipe, further: Array) -> Recipe:
    """The recipe with presliding of other sizes, by the logarithms of their factors, shape (m,)."""
    sizes = np.multiply(getattr(recipe, _kind(recipe)), np.exp(further)).tolist()
    size: Any = tuple(sizes) if len(sizes) > 1 else sizes[0]
    return replace(recipe, **{_kind(recipe): size})


_ROUNDS = 12
_QUARTER, _LITTLE = 0.25, 0.02  # of a sample, and of the logarithm of a size: of which derivatives are quotients
_FARTHEST = 0.01, 0.5  # in one round: delay [s], and logarithm of a size
_RANGE = 3.0  # of the logarithm
_SETTLED = 0.01  # change of the logarithm of the likelihood, twice
_STEEP = 10.0  # times the usual slope of a residual, as where friction jumps: such rows have no part


@dataclass(frozen=True, eq=False)
class DelayFit:
    """Delays of k groups of rows and the presliding, of all drives or of each, of the largest likelihood together.

    Friction that changes its direction over less, but later, is much alike, so that another presliding goes with each
    delay.
    """

    recipe: Recipe  # with the presliding
    delays: Array = field(default_factory=lambda: np.zeros(0))  # (k,) [s]; none where nothing is known of them
    ends: Array = field(default_factory=lambda: np.zeros((0, 2)))  # of their intervals [s]
    # (m,) of the logarithms of the presliding's sizes with the first delay [1/s]
    slope: Array = field(default_factory=lambda: np.zeros(1))

    def at(self, delay: float) -> Recipe:
        """The recipe with the presliding that goes with another delay of all rows."""
        if not self.slope.any():
            return self.recipe
        return _resized(self.recipe, np.clip(self.slope * (delay - self.delays).sum(), -_RANGE, _RANGE))

    @classmethod
    def where_smooth(cls, scoring: Scoring, recipe: Recipe, groups: Array, start: Array | float) -> DelayFit:
        """The fit; without delays where friction does not change its direction smoothly, before or after it."""
        fit = cls.of(scoring, recipe, groups, start) if _is_smooth(scoring, recipe) else cls(recipe)
        return fit if _is_smooth(scoring, fit.recipe) else cls(fit.recipe)

    @classmethod
    def of(cls, scoring: Scoring, recipe: Recipe, groups: Array, start: Array | float) -> DelayFit:
        """By Gauss and Newton with Tukey's weights; each size is known to a factor of e before."""
        # groups (k, L, r): 1 for the equations of each log that are in it
        step, k, m = scoring.step(recipe), len(groups), np.size(getattr(recipe, _kind(recipe)))
        x = np.append(np.full(k, start / step), np.zeros(m))  # delays in samples, logarithms of sizes over the given
        difference = np.repeat([_QUARTER, _LITTLE], [k, m])
        most, limit = (np.repeat([delay / step, size], [k, m]) for delay, size in (_FARTHEST, (LONGEST, _RANGE)))

        def residuals(x: Array) -> list[Array]:
            late = step * np.tensordot(x[:k], groups, 1)
            return _residuals(scoring, _resized(recipe, x[k:]), late, errors.weights)

        errors = scoring.of(scoring.statistics(recipe, step * np.tensordot(x[:k], groups, 1)))
        change = np.zeros(k + m)
        for _ in range(_ROUNDS):
            own, *ahead = (residuals(y) for y in (x, *(x + np.diag(difference))))
            likelihood = DelayLikelihood.of(own, errors)
            H = np.diag(np.repeat([0.0, 1.0], [k, m]))
            g = H @ x
            for e, size, weight, *others in zip(own, likelihood.sizes, likelihood.weights, *ahead, strict=True):
                J = (np.array(others) - e) / difference[:, None]
                steep = np.abs(J[:k]).sum(axis=0)
                J_w = weight * J * np.maximum(1 - (e / size / BISQUARE) ** 2, 0.0) ** 2 / size**2
                J_w[:, steep > _STEEP * np.median(steep)] = 0.0
                H, g = H + J_w @ J.T, g + J_w @ e
            newton = np.clip(-np.linalg.lstsq(H, g, rcond=None)[0], -most, most)
            change = newton / 2 if newton @ H @ change < 0 else newton  # which turns back
            x = np.clip(x + change, -limit, limit)
            if change @ H @ change < _SETTLED:
                break
        delays, variance = step * x[:k], step**2 * np.maximum(np.diag(np.linalg.pinv(H))[:k], 0.0)
        half = np.sqrt(2 * likelihood.margin() * variance) + TURN * step
        slope = -np.linalg.solve(H[k:, k:], H[k:, 0]) / step
        return cls(_resized(recipe, x[k:]), delays, np.column_stack([delays - half, delays + half]), slope)

    def with_shared(self) -> DelayFit:
        """One delay for the most groups whose intervals hold it: zero, or their mean."""
        half = np.ptp(self.ends, axis=1) / 2
        holds = np.array([(self.ends[:, 0] <= x) & (x <= self.ends[:, 1]) for x in (0.0, *self.delays)])
        alike = holds[np.argmax(holds.sum(axis=1))]
        mean = 0.0 if np.all(holds[0] >= alike) else np.average(self.delays[alike], weights=half[alike] ** -2.0)
        return replace(self, delays=np.where(alike, mean, self.delays))

    def applied(self, names: Sequence[str], groups: Array) -> Recipe:
        """The recipe with the delays of joints, whose groups have equations of every log, or of logs."""
        late = np.round(self.delays, 6).tolist()
        if np.all(np.any(groups, axis=2)):
            return replace(self.recipe, delay=tuple(late))
        common = max(late, key=late.count)
        further = {name: delay - common for name, delay in zip(names, late, strict=True) if delay != common}
        return replace(self.recipe, delay=common, log_delays=further)

    def choice(self, names: Sequence[str], one: LeftOut, each: LeftOut) -> Choice:
        """The choice of these delays instead of one of all, from the errors of both."""
        said = (
            f"{name} {1e3 * delay:.3g} ms ({1e3 * low:.3g} to {1e3 * high:.3g})"
            for name, delay, (low, high) in zip(names, self.delays, self.ends, strict=True)
        )
        gain = percent(1 - np.exp(each.score - one.score))
        reason = (
            f"torques are matched with an earlier motion, each with its own: {', '.join(said)}; beside one delay of "
            f"all, the error in cross-validation is lower by {gain}, the mean over the joints"
        )
        listed = candidates_of({"one of all": one, "of each": each})
        value, ends = tuple(np.round(self.delays, 6).tolist()), tuple(map(tuple, self.ends.tolist()))
        return Choice("delay", value, listed, reason, "s", intervals=ends)


_EACH_WORTH = 0.02  # of the score: below that all have one delay
_OFFSETS = 1e-3 * np.array([-40.0, -20.0, -10.0, -5.0, -2.0, 0.0, 2.0, 5.0, 10.0, 20.0, 40.0])  # that are tried [s]


def _with_delays_of_each(chosen: _Timing, timings: Sequence[_Timing], softened: Callable[[Recipe], Scoring]) -> _Timing:
    """Delays of single joints, or of single logs, where these are likelier than one of all, and predict clearly better.

    All kinds of presliding are tried again with them, for one that is wrong can stand for delays that differ. The
    chosen kind is first: the others are tried only where its delays are likelier. Coarse delays decide nothing, since
    they hardly show beside the presliding that goes with one delay.
    """
    recipe, common = replace(chosen[0], delay=0.0), chosen[2][0].value
    scoring = softened(recipe)
    errors = scoring.of(scoring.statistics(recipe, common))

    def is_likelier(fit: DelayFit, found: LeftOut, groups: Array) -> bool:
        """Whether further delays raise the likelihood by more than chance does."""
        late = np.tensordot(fit.delays, groups, 1)
        each = _residuals(softened(fit.recipe), fit.recipe, late, found.weights)
        likelihood = DelayLikelihood.of(each, found)
        one = likelihood.misfit_of(_residuals(scoring, recipe, common, found.weights))
        return one - likelihood.misfit_of(each) > likelihood.margin(len(groups) - 1)

    for names, groups in _groups(scoring, scoring.parts(recipe)).items():
        fits: dict[DelayFit, LeftOut] = {}
        for own in dict.fromkeys((recipe, *(replace(one[0], delay=0.0) for one in timings))):
            soft = softened(own)
            start, coarse = _coarse_delays(soft, own, groups, common)
            if errors.score - coarse.score > (_EACH_WORTH if own == recipe else 0.0):
                fit, found = _fit_of_each(soft, own, groups, start, smooth=len(timings) > 1)
                if np.all(np.abs(fit.delays) <= LONGEST + BEYOND / 2) and is_likelier(fit, found, groups):
                    fits[fit] = found
            if not fits and own == recipe:
                break
        if fits and fits[best := best_of(fits)].is_better(errors, _EACH_WORTH, 2.0):
            choice = best.choice(names, errors, fits[best])
            chosen, errors = (best.applied(names, groups), fits[best], (choice,)), fits[best]
    return chosen


def _fit_of_each(
    scoring: Scoring, recipe: Recipe, groups: Array, start: Array, *, smooth: bool
) -> tuple[DelayFit, LeftOut]:
    """Delays of each group with their errors, those of some shared where that predicts as well."""
    fit = DelayFit.where_smooth(scoring, recipe, groups, start) if smooth else DelayFit(recipe)
    fit = fit if fit.delays.size else _delays_in_turn(scoring, fit.recipe, groups, start)
    shared = fit.with_shared()
    with_shared, with_own = (
        scoring.of(scoring.statistics(one.recipe, np.tensordot(one.delays, groups, 1))) for one in (shared, fit)
    )
    return (fit, with_own) if with_shared.score - with_own.score > _EACH_WORTH else (shared, with_shared)


def _groups(scoring: Scoring, parts: Sequence[PreparedLog]) -> dict[tuple[str, ...], Array]:
    """Names of logs, and of joints, and their equations, shape (k, L, r)."""
    r, sources = len(scoring.target.model.row_labels), [part.log.source for part in parts]
    logs = tuple(dict.fromkeys(sources))
    groups = {}
    if len(logs) > 1:
        groups[logs] = np.array([[[source == log] * r for source in sources] for log in logs], dtype=float)
    joints, equations = scoring.target.robot.joint_names, scoring.target.model.torque_equations()
    if scoring.target.motion.complete and equations is not None and r == len(joints) > 1 and _has_friction(scoring):
        groups[joints] = np.repeat(np.eye(r)[:, None], len(parts), axis=1)
    return groups


def _has_friction(scoring: Scoring) -> bool:
    """Whether friction is known or among the parameters; where it is not, it looks like delays of the joints."""
    friction = scoring.target.model.coulomb_friction()
    among = friction is not None and np.isin(friction.columns, scoring.target.base.index).any()
    return scoring.trial.friction is not None or bool(among)


def _coarse_delays(scoring: Scoring, recipe: Recipe, groups: Array, common: float) -> tuple[Array, LeftOut]:
    """The best delay of each group in turn, beside one of all, by left-out errors."""
    grid = {delay: scoring.statistics(recipe, delay) for delay in (common + _OFFSETS).tolist()}
    blocks = [np.unique(block[block >= 0]).size for block in scoring.trial.blocks]
    rows = np.repeat(groups, blocks, axis=1) > 0  # (k, B, r)

    @cache
    def errors(*late: float) -> LeftOut:
        products = grid[common].products.copy()
        for own, delay in zip(rows, late, strict=True):
            products[own] = grid[delay].products[own]
        return scoring.of(replace(grid[common], products=products))

    late = (common,) * len(groups)
    for _ in range(_SWEEPS):
        for g in range(len(groups)):
            late = min(((*late[:g], delay, *late[g + 1 :]) for delay in grid), key=lambda tried: errors(*tried).score)
    return np.array(late), errors(*late)


_SWEEPS, _AROUND = 2, 0.005  # times; how far at first [s]


def _delays_in_turn(scoring: Scoring, recipe: Recipe, groups: Array, start: Array) -> DelayFit:
    """The delay of each group beside the others', by likelihood: where friction jumps nothing has a slope."""
    late, ends = start.copy(), np.zeros((len(start), 2))

    def along(g: int, weights: Array, delay: float) -> list[Array]:
        """Residuals where a group has another delay."""
        delays = np.where(np.arange(len(late)) == g, delay, late)
        return _residuals(scoring, recipe, np.tensordot(delays, groups, 1), weights)

    for _ in range(_SWEEPS):
        for g in range(len(groups)):
            errors = scoring.of(scoring.statistics(recipe, np.tensordot(late, groups, 1)))
            residuals = partial(along, g, errors.weights)
            likelihood = DelayLikelihood.of(residuals(late[g]), errors)
            late[g], ends[g] = likelihood.found(residuals, late[g], _AROUND, scoring.step(recipe))
    return DelayFit(recipe, late, ends)


_SLIDING_WORTH = 0.005  # of the score: below that the exact sign stays
_HOLDING = 0.05, 0.1  # of the score: what a direction at standstill is worth, and one that needs less delay


def choose_timing(scoring: Scoring, recipe: Recipe, free: frozenset[str]) -> Chosen:
    """Choose the presliding of friction and the delay of the torques.

    A friction that changes its direction late looks like a delay; so each kind of presliding is tried with its own best
    delay. Presliding over a distance is preferred where it predicts as well as the best, within 5 % of the errors: only
    it has a direction at standstill, which exciting motions hardly show, but others do; and within 10 % where it needs
    less delay, since a sign that is smooth and late stands for it. None with a larger delay than the best is preferred.
    """
    scoring = scoring.prepared_by(recipe)
    softened = cache(scoring.softened)

    @cache
    def scored(recipe: Recipe, delay: float) -> LeftOut:
        return softened(recipe).of(softened(recipe).statistics(recipe, delay))

    def along(tried: Recipe, start: float = 0.0) -> DelayFit:
        return DelayFit.where_smooth(scoring, tried, np.ones((1, 1, 1)), start) if together else DelayFit(tried)

    def timing(tried: Recipe, along: DelayFit) -> _Timing:
        """Best delay of a kind of presliding, and then its best size at that delay."""
        if "delay" not in free:
            return tried, scored(tried, 0.0), ()
        delay, choice = delay_of(softened(tried), along, tried)
        resized = min((tried, along.at(delay)), key=lambda one: scored(one, delay).score)
        low, high = choice.interval if delay and choice.interval else (0.0, 0.0)
        alike = [delay, *(one.value for one in choice.candidates if low <= one.value <= high)]
        return (
            replace(resized, delay=delay),
            min((scored(resized, one) for one in alike), key=lambda one: one.score),
            (choice,),
        )

    slidings = _slidings(scoring, recipe)
    together = "delay" in free and len(slidings) > 1
    timings = [timing(tried, along(tried)) for tried in slidings]
    (presliding, errors, _), distance = timings[-1], timings[-1][0].breakaway
    if together and distance and _is_smooth(scoring, presliding) and errors.is_better(timings[0][1], _SLIDING_WORTH):
        own: Any = (distance,) * len(friction_rows(scoring.target.robot))
        each = along(replace(presliding, delay=0.0, breakaway=own), presliding.common_delay)
        if each.delays.size and scored(each.recipe, each.delays.item()).is_better(errors, LEAST_GAIN):
            timings.append(timing(each.recipe, each))
    best = min(timings, key=lambda one: one[1].score)

    def with_no_more_delay(one: _Timing) -> _Timing:
        delay = best[0].common_delay
        return (replace(one[0], delay=delay), scored(one[0], delay), best[2]) if _later(one[0], best[0]) else one

    exact, last = with_no_more_delay(timings[0]), with_no_more_delay(timings[-1])
    chosen = best
    if best[1].score > exact[1].score - _SLIDING_WORTH:
        chosen = exact
    elif last[0].breakaway and last[1].score - best[1].score <= _HOLDING[_later(best[0], last[0])]:
        chosen = last
    if chosen[2]:
        chosen = _with_delays_of_each(chosen, timings, softened)
    if len(timings) == 1:
        return chosen[0], chosen[2]
    words = presliding_words(chosen[0])
    listed = candidates_of({presliding_words(tried): errors for tried, errors, _ in timings})
    return chosen[0], (*chosen[2], Choice("presliding", words, listed, f"{words}, by cross-validation"))


def _later(one: Recipe, other: Recipe) -> bool:
    return abs(one.common_delay) > abs(other.common_delay)


def _slidings(scoring: Scoring, recipe: Recipe) -> list[Recipe]:
    if recipe.sign_width is not None or recipe.breakaway is not None:
        return [replace(recipe, sign_width=recipe.sign_width or 0.0, breakaway=recipe.breakaway or 0.0)]
    asked, known = (recipe, scoring.target, id(scoring.trial.friction)), scoring.trial.slidings
    if asked not in known:
        known[asked] = presliding_candidates(recipe, scoring.target, scoring.parts(recipe), scoring.trial.friction)
    return [replace(recipe, **sliding) for sliding, _ in known[asked]]


_Timing = tuple[Recipe, LeftOut, tuple[Choice, ...]]

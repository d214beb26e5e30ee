"""Delay of torques after the motion, by left-out errors and, below half a sample, by likelihood."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy

from excite.identification.choices.left_out import NEGLIGIBLE, Choice, LeftOut, candidates_of
from excite.identification.noise import autocorrelation, effective_samples
from regressors.errors import percent
from regressors.samples import Array

Scored = Callable[[float], LeftOut]

LONGEST = 0.05  # [s]
BEYOND = 0.01  # that is searched beyond it, so that it is inside the range [s]
_GRID = 0.01  # [s]
_PRECISION = 0.01  # of the sample time
LEAST_GAIN = 0.002  # of the score

Residuals = Callable[[float], list[Array]]  # of each equation under a delay, (N,)


def choose_delay(
    scored: Scored, residuals: Callable[[Array, float], list[Array]], step: float, near: float | None = None
) -> tuple[float, Choice]:
    """Delay of the torques after the motion; zero where its interval holds zero, or it predicts no better than none.

    Both neighbours are tried at distances that are halved, from 10 ms to a hundredth of a sample: by left-out errors,
    and below half a sample by `DelayLikelihood`, for a single reversal of friction that lies in the wrong row moves the
    errors' minimum. The delay is the mean by that likelihood; the interval holds delays that are as likely.
    """  # residuals of each equation with the weights of all, (r,), and a delay
    tried: dict[float, LeftOut] = {}

    def score(delay: float) -> float:
        if abs(delay) > LONGEST + BEYOND:
            return np.inf
        if delay not in tried:
            tried[delay] = scored(delay)
        return tried[delay].score

    score(near := _descent(score, 0.0, _GRID, step / 2) if near is None else near)
    weighted = partial(residuals, tried[near].weights)
    best, (low, high) = DelayLikelihood.of(weighted(near), tried[near]).found(weighted, near, step / 2, step)
    gain = score(0.0) - score(best)
    listed = candidates_of(dict(sorted(tried.items())))
    inside = abs(best) <= LONGEST + BEYOND / 2
    if low <= 0.0 <= high or not inside or gain < LEAST_GAIN:
        reason = "torques and positions are taken as recorded at the same time: no delay predicts clearly better"
        return 0.0, Choice("delay", 0.0, listed, reason, "s", (min(low, 0.0), max(high, 0.0)) if inside else None)
    when = "before" if best > 0 else "after"
    near, far = sorted((1e3 * abs(low), 1e3 * abs(high)))
    reason = (
        f"torques are matched with the motion {1e3 * abs(best):.3g} ms {when} them ({near:.3g} to {far:.3g} ms): error "
        f"in cross-validation lower by {percent(1 - np.exp(-gain))}, the mean over the joints; friction at its "
        "reversals can look like a delay"
    )
    return best, Choice("delay", best, listed, reason, "s", (low, high))


def _descent(misfit: Callable[[float], float], best: float, distance: float, least: float) -> float:
    """Delay of a small misfit: the better neighbour, or half the distance where none is better, down to the least."""
    while distance > least:
        near = min((best, round(best - distance, 9), round(best + distance, 9)), key=misfit)
        distance, best = (distance / 2 if near == best else distance), near
    return best


_LEVEL = 0.01  # of the interval: what lies outside
_NORMAL = 1.4826  # deviation of a normal distribution over its median absolute value
BISQUARE = 4.685  # standard deviations beyond which a residual counts no further [Beaton, Tukey 1974]
_MOST = BISQUARE**2 / 6  # that it counts
TURN = 0.1  # of a sample: how exactly it is known between which rows a drive turns
_EDGE = 0.1  # of an interval's half: how exactly its end is found


@dataclass(frozen=True, eq=False)
class DelayLikelihood:
    """Likelihood of delays, to whose logarithm a row on the wrong side of a reversal contributes 3.7 at most."""

    sizes: Array  # (r,) deviation of the residuals
    weights: Array  # (r,) share of the residuals that is independent
    independent: float  # of all residuals

    @classmethod
    def of(cls, own: list[Array], errors: LeftOut) -> DelayLikelihood:
        """Sizes and correlation are those of some residuals."""
        least = NEGLIGIBLE * np.sqrt(errors.sizes / errors.instants)
        independent = np.array([effective_samples(autocorrelation(e), e.size) for e in own])
        weights = independent / [e.size for e in own]
        sizes = np.maximum([_NORMAL * np.median(np.abs(e)) for e in own], least)
        return cls(sizes, weights, float(independent.sum()))

    def margin(self, count: int = 1) -> float:
        """Of the logarithm, about the best of some delays; one row may be on the wrong side."""
        spread = count * scipy.special.fdtri(count, self.independent, 1 - _LEVEL) / 2
        return float(spread + _MOST * self.weights.max())

    def misfit_of(self, own: list[Array]) -> float:
        """Minus the logarithm: Tukey's bisquare, which is half the square of small deviations."""
        shares = [1 - np.maximum(1 - (e / s / BISQUARE) ** 2, 0.0) ** 3 for e, s in zip(own, self.sizes, strict=True)]
        return _MOST * float(self.weights @ [share.sum() for share in shares])

    def found(
        self, residuals: Residuals, near: float, distance: float, step: float
    ) -> tuple[float, tuple[float, float]]:
        """Mean by likelihood of the delays about one that is near, and the ends of their interval."""
        tried: dict[float, float] = {}

        def misfit(delay: float) -> float:
            if abs(delay) > LONGEST + BEYOND:
                return np.inf
            if delay not in tried:
                tried[delay] = self.misfit_of(residuals(delay))
            return tried[delay]

        near = _descent(misfit, near, distance, _PRECISION * step)
        low, high = (self.edge(misfit, near, side, step) for side in (-1.0, 1.0))
        delays, misfits = np.array(sorted(tried.items())).T
        likelihoods = np.exp(misfits.min() - misfits)
        mean = np.trapezoid(delays * likelihoods, delays) / np.trapezoid(likelihoods, delays)
        return round(float(mean), 6), (low, high)

    def edge(self, misfit: Callable[[float], float], best: float, side: float, step: float) -> float:
        """End of the interval on one side of the best."""
        inner, outer, most = 0.0, step / 4, misfit(best) + self.margin()
        while misfit(round(best + side * outer, 9)) <= most and outer < LONGEST:
            inner, outer = outer, 2 * outer
        while outer - inner > _EDGE * outer and outer > _PRECISION * step:
            middle = (inner + outer) / 2
            outside = misfit(round(best + side * middle, 9)) > most
            inner, outer = (inner, middle) if outside else (middle, outer)
        return round(best + side * (outer + TURN * step), 9)

"""Choice of the cutoff of the positions' low-pass, and of the delay of the torques."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import scipy.optimize
import scipy.stats

from excite.identification.choices.choice import Candidate, Choice
from excite.identification.choices.left_out import LeftOut
from excite.identification.recipe import Recipe
from regressors.samples import Array

Scored = Callable[[Recipe], LeftOut]

_STEP = 2.0  # between the cutoffs that are tried first
PERIODS = 2.0  # of the cutoff that are cut from each end, see `excite.signals.low_pass.edge`
_CUT = 0.05  # largest share of a log that may be cut from each end
_HIGHEST = 0.35  # of the sample rate


def cutoff_candidates(duration: float, rate: float) -> list[float]:
    """Cutoffs to try, from the lowest that leaves nine tenths of a log to 0.35 of the sample rate [Hz].

    None where a log has too few rows for both.
    """
    highest = _HIGHEST * rate
    lowest = PERIODS / (_CUT * duration)
    if lowest > highest:
        return []
    count = int(np.floor(np.log(highest / lowest) / np.log(_STEP))) + 1
    return [float(highest / _STEP**k) for k in range(count)][::-1]


def choose_cutoff(candidates: Sequence[float], recipe: Recipe, scored: Scored) -> tuple[Recipe, Choice]:
    """Cutoff whose motion predicts left-out torques best: by octaves, then between the neighbours of the best.

    A cutoff that is too low loses motion; one that is too high lets noise through, which spoils the accelerations.
    """
    scores = {cutoff: scored(replace(recipe, cutoff=cutoff)) for cutoff in candidates}
    for ratio in (np.sqrt(_STEP), np.sqrt(np.sqrt(_STEP))):
        best = min(scores, key=lambda cutoff: scores[cutoff].score)
        for near in (best / ratio, best * ratio):
            if min(scores) < near < max(scores) and not any(abs(np.log(near / c)) < 1e-6 for c in scores):
                scores[near] = scored(replace(recipe, cutoff=near))
    best = min(scores, key=lambda cutoff: scores[cutoff].score)
    value = float(f"{best:.3g}")
    listed = tuple(Candidate(cutoff, s.error, s.score) for cutoff, s in sorted(scores.items()))
    return replace(recipe, cutoff=value), Choice("cutoff", value, listed, _reason(value, scores, best), "Hz")


def _reason(value: float, scores: dict[float, LeftOut], best: float) -> str:
    last = max(scores)
    text = f"positions are low-passed at {value:g} Hz, which predicts left-out torques to {_percent(scores[best])}"
    return text if last == best else f"{text} ({last:.3g} Hz: {_percent(scores[last])})"


def _percent(score: LeftOut) -> str:
    return f"{100 * score.error:.3g} %"


LONGEST = 0.05  # [s]
_GRID = 0.01  # [s]
_PRECISION = 1e-5  # [s]
_CONVINCING = 2.0  # standard errors

ScoredDelay = Callable[[float], LeftOut]


def choose_delay(scored: ScoredDelay, step: float) -> tuple[float, Choice]:
    """Delay of the torques after the motion; zero where it does not predict left-out torques clearly better.

    Nor is a delay taken whose interval contains zero, or that is at the end of the range that is searched.
    """
    zero = scored(0.0)
    tried = {0.0: zero}

    def score(delay: float) -> float:
        tried[float(delay)] = scored(float(delay))
        return tried[float(delay)].score

    near = min((-_GRID, 0.0, _GRID), key=score)
    while abs(near) < LONGEST and near and score(further := near + np.copysign(_GRID, near)) < tried[near].score:
        near = further
    scipy.optimize.minimize_scalar(
        score, bounds=(near - _GRID, near + _GRID), method="bounded", options={"xatol": max(_PRECISION, 0.01 * step)}
    )
    best = min(tried, key=lambda delay: tried[delay].score)
    gain, deviation = tried[best].gain_over(zero)
    listed = tuple(Candidate(delay, s.error, s.score) for delay, s in sorted(tried.items()))
    half = _half_width(scored, best, max(0.1 * step, 1e-4))
    sure = half < abs(best) < LONGEST
    if not sure or gain < max(_CONVINCING * deviation, LEAST_GAIN):
        reason = "torques and positions are taken as recorded at the same time: no delay predicts clearly better"
        return 0.0, Choice("delay", 0.0, listed, reason, "s")
    best = round(best, 6)
    when = "before" if best > 0 else "after"
    reason = (
        f"torques are matched with the motion {1e3 * abs(best):.3g} +- {1e3 * half:.2g} ms {when} them, which lowers "
        f"the errors of left-out torques by {100 * (1 - np.exp(-gain)):.2g} %, the mean over the joints; what friction "
        "does at its reversals can look like a delay"
    )
    return best, Choice("delay", best, listed, reason, "s", (best - half, best + half))


LEAST_GAIN = 0.002  # of the score


def _half_width(scored: ScoredDelay, delay: float, h: float) -> float:
    """Half of the 99 % interval, by leaving one block after the other out of a parabola of the errors [s].

    Its points are h apart, which is added: friction jumps from row to row, so that nearer delays look alike.
    """
    below, at, above = (scored(delay + shift) for shift in (-h, 0.0, h))
    weights = at.weights
    rows = np.array([(s.squares * weights).sum(axis=1) for s in (below, at, above)])
    minima = np.array([_vertex(rows.sum(axis=1) - row, h) for row in rows.T])
    count = minima.size
    deviation = np.sqrt((count - 1) / count * np.sum((minima - minima.mean()) ** 2))
    return h + float(scipy.stats.t.ppf(0.995, count - 1) * deviation)


def _vertex(values: Array, h: float) -> float:
    """Place of the minimum of a parabola through three values, h apart, from the middle one."""
    curvature = values[0] - 2 * values[1] + values[2]
    return float(h / 2 * (values[0] - values[2]) / curvature) if curvature > 0 else 0.0

"""Choice of the cutoff of the positions' low-pass."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from excite.identification.choices.choice import Candidate, Choice
from excite.identification.choices.left_out import LeftOut
from excite.identification.recipe import Recipe

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

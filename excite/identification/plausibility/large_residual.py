"""Doubt where the model does not explain what was measured, with its cause."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from excite.identification.plausibility.doubt import Doubt
from excite.identification.plausibility.residual_causes import MOST, NoisyDerivatives, WrongFactors

LARGEST = 0.30  # residual over measurement
_ODD = 1.3  # factor from which on a measurement counts as scaled


@dataclass(frozen=True)
class ResidualCauses:
    """What is known of a large residual."""

    names: tuple[str, ...]  # of the equations
    factors: WrongFactors
    noisy: NoisyDerivatives
    # share that ``friction``, ``rotor`` and ``offset`` explain, which the model may have or not
    terms: dict[str, float]
    per_joint: tuple[float, ...]  # share that all of these terms explain in each equation
    without_curve: tuple[str, ...]  # drives that move and have no friction curve, where friction is known


def large_residual(relative: float, noise: float, causes: ResidualCauses) -> Doubt | None:
    """Doubt where the residual, less the noise of the measurement, is above 30 % of what was measured."""
    unexplained = float(np.sqrt(max(relative**2 - noise**2, 0.0)))
    if not unexplained > LARGEST:
        return None
    of_noise = f", of which {100 * noise:.2g} % may be noise of the measurement" if noise > 0.1 * relative else ""
    what = f"the residual is {100 * relative:.3g} % of what was measured{of_noise}, more than {100 * LARGEST:g} %"
    return Doubt(what, *_cause(causes))


def _cause(causes: ResidualCauses) -> tuple[str, str]:
    """Cause and cure: the first that explains more than half."""
    term = max(causes.terms, key=lambda name: causes.terms[name])
    if causes.noisy.cause is not None:
        return causes.noisy.cause
    if causes.terms[term] > MOST:  # before factors, which also fit what the model lacks
        return _term(causes, term)
    if causes.factors.explained > MOST and (odd := _odd(causes)):
        return _factor(odd, causes.factors.explained)
    return (
        "no single cause explains it",
        "check in the mapping the units, the signs and the order of the joints, that positions and torques belong to "
        "the same instants, and lower the cutoff (`cutoff`)",
    )


def _term(causes: ResidualCauses, term: str) -> tuple[str, str]:
    largest = [causes.names[j] for j in np.flatnonzero(np.array(causes.per_joint) > 0.2 * max(causes.per_joint))]
    share = f"{100 * causes.terms[term]:.0f} % of it (squared)"
    if term == "friction" and causes.without_curve:
        return (
            f"there is no friction curve for {', '.join(causes.without_curve)}, so that it counts as zero and "
            f"friction explains {share}",
            "fit curves for these drives too, or identify friction with the other parameters (`friction=True` "
            "without `friction_curves`)",
        )
    option = {"friction": "friction=True", "rotor": "joint_rotors=True", "offset": "offset=True"}[term]
    return (
        f"{_TERMS[term]} of {_listed(largest)} explains {share} and is not in the model",
        f"identify it too (`{option}`)",
    )


_TERMS = {"friction": "friction", "rotor": "an inertia of its own", "offset": "a constant torque"}


def _odd(causes: ResidualCauses) -> dict[str, float]:
    """Equations whose factor differs from the others'."""
    pairs = zip(causes.names, causes.factors.factors, strict=True)
    return {name: s for name, s in pairs if not 1 / _ODD < s < _ODD}


def _factor(odd: dict[str, float], explained: float) -> tuple[str, str]:
    shown = ", ".join(f"{name} times {s:.3g}" for name, s in odd.items())
    return (
        f"the measurements fit each other only with {shown}, which explains {100 * explained:.0f} % of it (squared)",
        "check sign, unit, gain and ratio of these joints in the mapping",
    )


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names)

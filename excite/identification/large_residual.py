"""Reasons to doubt a result, and the doubt where the model does not explain what was measured, with its causes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy.linalg
import scipy.signal

from excite.identification.observations import Observations, rows_of_groups
from regressors.samples import Array


@dataclass(frozen=True)
class Doubt:
    """A reason to doubt a result."""

    what: str  # what cannot be right, with its numbers
    cause: str  # why, as far as the data show it
    cure: str  # what to do, with options in backticks
    about: Literal["bodies", "torques"] = "bodies"  # which question it answers with no

    @property
    def text(self) -> str:
        """One sentence."""
        return f"{self.what}: {self.cause}; {self.cure}"


_MOST_LEFT_OUT = 0.05  # of the exciting rows


def left_out_rows(source: str, share: float) -> Doubt | None:
    """Warning where more than 5 % of the exciting rows are left out."""
    if not share > _MOST_LEFT_OUT:
        return None
    return Doubt(
        f"{100 * share:.2g} % of the exciting rows of {source} are left out, more than {100 * _MOST_LEFT_OUT:g} %",
        "the motion that remains is no longer the one that was played",
        "see the notes on this log for which rows and why; record it again without these events, or give the stretch "
        "that is sound (`rows`)",
    )


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
    return Doubt(what, *_cause(causes), about="torques")


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
        f"{_TERMS[term]} of {', '.join(largest)} explains {share} and is not in the model",
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


MOST = 0.5  # share of the squared residual that makes a cause the cause
_MOST_ROWS = 30000  # for factors, which need no more
_FEWEST = 50  # rows of a spectrum
_STRETCH = 2**16  # rows of a long one


@dataclass(frozen=True)
class WrongFactors:
    """Factors of the measurements with which the equations hold best."""

    explained: float  # share of the squared residual, relative to what was measured, that they explain
    factors: tuple[float, ...]  # of each equation, their median being one


def wrong_factors(observations: Observations) -> WrongFactors:
    """Factors of single equations' measurements with which the model explains them better.

    With ``Y = diag(s) y`` and Q an orthonormal basis of W's columns, ``||(1 - QQ') Y||^2 / ||Y||^2`` is a ratio of
    quadratic forms of s, r x r. One equation after the other gets the factor that lowers it most, as long as that
    halves it. A factor far from one, or negative, is a unit, a ratio or a sign that does not fit the others.
    """
    r = len(observations.equations)
    if observations.y.size > _MOST_ROWS:
        rng = np.random.default_rng(0)
        observations = observations.rows(np.sort(rng.choice(observations.y.size, _MOST_ROWS, replace=False)))
    Y = np.zeros((observations.y.size, r))
    Y[np.arange(observations.y.size), observations.equation] = observations.y
    left = Y - _projected(observations.matrix, Y)
    A, size = left.T @ left, np.sum(Y**2, axis=0)
    s = np.ones(r)
    plain = best = _unexplained(A, size, s)
    for _ in range(r - 1):
        trials = [_with_factor(A, size, s, j) for j in range(r)]
        j = int(np.argmin([_unexplained(A, size, trial) for trial in trials]))
        if not _unexplained(A, size, trials[j]) < best / 2:
            break
        s, best = trials[j], _unexplained(A, size, trials[j])
    return WrongFactors(1 - best / plain if plain > 0 else 0.0, tuple(s.tolist()))


def _unexplained(A: Array, size: Array, s: Array) -> float:
    total = float(size @ s**2)
    return float(s @ A @ s) / total if total > 0 else 0.0


def _with_factor(A: Array, size: Array, s: Array, j: int) -> Array:
    """The factors, that of equation j being the best: stationary points of a ratio of two parabolas in it."""
    others = np.where(np.arange(s.size) == j, 0.0, s)
    a, b, c = A[j, j], 2 * float(A[j] @ others), float(others @ A @ others)
    d, e = size[j], float(size @ others**2)
    points = np.roots([-b * d, 2 * (a * e - c * d), b * e])  # of (a x^2 + b x + c) / (d x^2 + e)
    trials = [np.where(np.arange(s.size) == j, x, s) for x in points[np.isreal(points)].real]
    return min(trials, key=lambda trial: _unexplained(A, size, trial), default=s)


def _projected(W: Array, Y: Array) -> Array:
    """Projection of Y onto the columns of W."""
    sizes = np.linalg.norm(W, axis=0)
    Q, R, _ = scipy.linalg.qr(W / np.where(sizes > 0, sizes, 1.0), mode="economic", pivoting=True)
    diagonal = np.abs(np.diag(R))
    Q = Q[:, diagonal > 1e-10 * diagonal.max(initial=0.0)]
    return np.asarray(Q @ (Q.T @ Y))


@dataclass(frozen=True)
class NoisyDerivatives:
    """Noise in the predictions, which comes from differentiated positions."""

    share: float  # its power over the squared residual
    above: float  # frequency above which the motion has no content [Hz]

    @property
    def cause(self) -> tuple[str, str] | None:
        """Cause and cure in words, if it is more than half of the squared residual."""
        if not self.share > MOST:
            return None
        return (
            f"the torques that the model predicts are mostly noise above {self.above:.3g} Hz, where the motion has "
            "no content: the positions are noisy, or their time stamps are",
            f"filter the positions with a lower cutoff, such as `cutoff={self.above:.2g}`",
        )


def noisy_derivatives(observations: Observations, predicted: Array, above: float) -> NoisyDerivatives:
    """Power above the motion's frequencies that the residual has and the measurements have not, over all of its power.

    What the measurements have too is noise of theirs, or jumps of friction, which the predictions share.
    """  # predicted (m,)
    residual = observations.y - predicted
    fast, total = 0.0, float(np.sum(residual**2))
    for _, rows in rows_of_groups(observations.group):
        time = observations.time[rows]
        if time.size < _FEWEST or not time[-1] > time[0]:
            continue
        rate = (time.size - 1) / float(time[-1] - time[0])
        in_residual, in_measured = (_fast(x[rows], rate, above) for x in (residual, observations.y))
        fast += time.size * max(in_residual - in_measured, 0.0)
    return NoisyDerivatives(fast / total if total > 0 else 0.0, above)


def _fast(x: Array, rate: float, above: float) -> float:
    """Mean square above a frequency; of long signals the mean over their stretches [Welch 1967]."""
    frequency, power = scipy.signal.welch(x, rate, "hann", nperseg=min(x.size, _STRETCH))
    return float(np.sum(power[frequency > above]) * frequency[1])


def missing_terms(residual: Array, speed: Array, acceleration: Array) -> tuple[dict[str, float], Array]:
    """What friction and rotors of its own joint explain of each joint's residual."""
    # residual, speed, acceleration (N, r); result (r,)
    total = float(np.sum(residual**2))
    one = np.ones(len(residual))
    explained: dict[str, float] = dict.fromkeys(("friction", "rotor", "offset"), 0.0)
    per_joint = np.zeros(residual.shape[1])
    for j in range(residual.shape[1]):
        e, v, a = residual[:, j], speed[:, j], acceleration[:, j]
        terms = {"friction": [np.sign(v), v], "rotor": [a], "offset": [one]}
        for name, columns in terms.items():
            explained[name] += _explained(e, columns) / total
        per_joint[j] = _explained(e, [column for columns in terms.values() for column in columns]) / total
    return explained, per_joint


def _explained(e: Array, columns: list[Array]) -> float:
    A = np.column_stack(columns)
    return float(np.sum((A @ np.linalg.lstsq(A, e, rcond=None)[0]) ** 2))

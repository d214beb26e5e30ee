"""Errors of predicted torques, less the noise of the measurement [KD96] section 7, and a verdict in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from excite.logs.signals.periods import MeasurementNoise
from excite.tasks.further_settings import Tolerances
from excite.verification.simulated_motion import MotionError
from regressors.errors import listed_names, percent
from regressors.samples import Array

MORE_THAN_TRAINING = 2.0
_NOISY = 0.9  # of the raw error: noise is mentioned where the error without it is less


@dataclass(frozen=True)
class Verdict:
    """Verdict on a result, equation by equation."""

    against: tuple[str, ...] = ()  # reasons against the result; empty if it holds
    remarks: tuple[str, ...] = ()  # remarks that do not affect the verdict
    # equations whose torques the log confirms, contradicts, and cannot judge; all empty in files of older versions
    confirmed: tuple[str, ...] = ()
    contradicted: tuple[str, ...] = ()
    undecided: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()  # equations that the log contradicts only as far as the result's uncertainty reaches
    # a sentence each: whether the torques of the log are predicted, whether a possible robot has the parameters, and
    # which of them are known
    answers: tuple[str, ...] = ()

    @property
    def holds(self) -> bool:
        """True where nothing is against the result."""
        return not self.against

    @property
    def text(self) -> str:
        """One or two sentences."""
        confirmed = ", ".join(self.confirmed)
        if not self.holds:
            partly = confirmed and (self.contradicted or self.unknown)
            only = f" Predictions of {confirmed} hold." if partly else ""
            return f"Do not rely on the result: {'; '.join(self.against)}.{only}"
        if self.undecided:
            return (
                f"The result predicts {confirmed} of this log: you can rely on it there for motions of this kind. "
                f"The log cannot judge {', '.join(self.undecided)}: noise hides the torques there."
            )
        return "The result predicts this log: you can rely on it for motions of this kind."

    def within_region(self, best: Verdict, parameters: Sequence[str]) -> Verdict:
        """The verdict beside that on the best prediction within the 99 % region of the parameters.

        What the log then no longer contradicts, the result does not know.
        """
        unknown = tuple(name for name in self.contradicted if name not in best.contradicted)
        if not unknown:
            return self
        reason = (
            f"the torques of {', '.join(unknown)} are not known well enough: within the 99 % intervals of "
            f"{listed_names(parameters)} they agree with this log; identify from this log too"
        )
        return replace(self, against=(*best.against, reason), contradicted=best.contradicted, unknown=unknown)


def verdict(
    torques: Sequence[TorqueError],
    corrected: Sequence[CorrectedError],
    total: float,
    whole: CorrectedError,
    training: float | None,
    motions: Sequence[MotionError],
    doubted: Sequence[str],
    tolerances: Tolerances,
) -> Verdict:
    """Judge each equation by its error in motion without the noise of the measurement, and the result by its doubts.

    A joint at standstill may carry any torque up to its static friction, so that what differs there is left out. The
    simulated motion is a remark: a small error of a torque moves a joint of little inertia far.
    """
    of_total, remarks = _of_total(whole, in_motion(torques), total, training, tolerances)
    named: dict[str, list[str]] = {"confirmed": [], "contradicted": [], "undecided": []}
    poor: list[str] = []
    for t, part in zip(torques, corrected, strict=True):
        moving = in_motion([t])
        if part.relative * moving <= tolerances.torque:
            named["confirmed"].append(t.name)
            if part.relative > 2 * tolerances.torque:
                within = f"{t.name} is predicted within {percent(t.relative, 3)} only"
                remarks.append(f"{within}, most of it from {t.limited_by}")
        elif part.least * moving <= tolerances.torque:
            named["undecided"].append(t.name)
        else:
            named["contradicted"].append(t.name)
            poor.append(f"{t.name} {percent(part.relative * moving, 3)}")
    against = [*doubted, *of_total]
    if poor:
        against.append(
            f"without noise, torques in motion miss {', '.join(poor)} of what was measured, more than "
            f"{100 * tolerances.torque:g} %"
        )
    elif not named["confirmed"] and not against:
        names = ", ".join(t.name for t in torques)
        against.append(f"this log cannot judge it: noise is as large as the torques of {names}")
    far = [m for m in motions if math.isfinite(m.relative) and m.relative > tolerances.motion]
    if far:
        by = ", ".join(f"{m.name} by {m.error:.3g} {m.unit} ({percent(m.relative, 3)})" for m in far)
        remarks.append(
            f"simulation drifts by more than {100 * tolerances.motion:g} % of the travel, as light joints do: {by}; "
            "the verdict is on the torques"
        )
    return Verdict(tuple(against), tuple(remarks), **{key: tuple(names) for key, names in named.items()})


def in_motion(torques: Sequence[TorqueError]) -> float:
    """Part of the error without noise that arises in motion, over some equations."""
    square, systematic, standstill = np.array([(t.error**2, t.systematic, t.standstill) for t in torques]).T
    slow = square @ (systematic + standstill)
    return float(np.sqrt(square @ systematic / slow)) if slow > 0 else 1.0


def _of_total(
    whole: CorrectedError, moving: float, total: float, training: float | None, tolerances: Tolerances
) -> tuple[list[str], list[str]]:
    """Reasons against the result by its error in motion over all equations, and remarks on it."""
    against: list[str] = []
    remarks: list[str] = []
    noisy = whole.noise > 0 and whole.relative < _NOISY * total
    without = f", {percent(whole.relative)} without the noise of the measurement" if noisy else ""
    if not whole.least * moving <= tolerances.torque:
        against.append(
            f"predictions miss {percent(total, 3)} of what was measured{without}, "
            f"more than {100 * tolerances.torque:g} %"
        )
    elif noisy and total > tolerances.torque:
        within = f"within {percent(whole.relative)}"
        if whole.relative > tolerances.torque:
            within = f"somewhere within {percent(whole.relative)}, which its noise leaves open"
        remarks.append(
            f"of the error of {percent(total, 3)} most is noise of the measurements; without it they are predicted "
            f"{within}"
        )
    if training is not None and training > 0 and whole.least * moving > MORE_THAN_TRAINING * training:
        ratio = whole.relative * moving / training
        times = "over 1000" if ratio > 1000 else f"{ratio:.3g}"
        text = (
            f"the error of {percent(whole.relative * moving)} is {times} times that on the logs of the identification "
            f"({percent(training)})"
        )
        if whole.least * moving > tolerances.torque / 2:
            against.append(f"{text}: the result does not generalise")
        else:
            remarks.append(f"{text}: this log is noisier, or its motion is of another kind")
    return against, remarks


NOISE_ABOVE = 10.0  # frequency above which the motion itself has no content [Hz]
STANDSTILL = 0.02  # of the largest speed of a joint: below, its static friction is undetermined


@dataclass(frozen=True)
class TorqueError:
    """How well one equation is predicted."""

    name: str
    unit: str
    measured: float  # root mean square of the measurements [unit]
    error: float  # root mean square of the difference [unit]
    relative: float  # the ratio of the two; infinite where nothing was measured
    worst: float  # largest difference [unit]
    worst_time: float  # when [s]
    # shares of the squared error, of sum 1: fast changes that no model of the motion explains; the rest of it while the
    # joint is at standstill; and the remainder, an error of the model
    noise: float
    standstill: float
    systematic: float

    @property
    def limited_by(self) -> str:
        """Name of the largest part of the error."""
        parts = {
            "noise of the measurement": self.noise,
            "static friction at standstill": self.standstill,
            "the model (friction, gains, flexibility)": self.systematic,
        }
        return max(parts, key=parts.__getitem__)


def at_standstill(speed: Array) -> NDArray[np.bool_]:
    """Where the coordinate of each equation hardly moves, shape (N, r)."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(speed) < STANDSTILL * np.abs(speed).max(axis=0, initial=0.0))


def torque_errors(
    time: Array, measured: Array, predicted: Array, still: NDArray[np.bool_], equations: tuple[tuple[str, str], ...]
) -> tuple[TorqueError, ...]:
    """Errors of every equation over a motion."""  # time (N,); measured, predicted (N, r); still (N, r), at standstill
    difference = measured - predicted
    slow = _slow(time, difference)
    errors = []
    for j, (name, unit) in enumerate(equations):
        e, s = difference[:, j], slow[:, j]
        total, size = float(np.mean(e**2)), float(np.sqrt(np.mean(measured[:, j] ** 2)))
        worst = int(np.argmax(np.abs(e)))
        noise = min(float(np.mean((e - s) ** 2)), total) / total if total > 0 else 0.0
        resting = float(np.sum(s[still[:, j]] ** 2)) / float(np.sum(s**2)) if np.any(s) else 0.0
        errors.append(
            TorqueError(
                name=name,
                unit=unit,
                measured=size,
                error=float(np.sqrt(total)),
                relative=float(np.sqrt(total)) / size if size > 0 else np.inf,
                worst=float(np.abs(e[worst])),
                worst_time=float(time[worst]),
                noise=noise,
                standstill=(1 - noise) * resting,
                systematic=(1 - noise) * (1 - resting),
            )
        )
    return tuple(errors)


def _slow(time: Array, values: Array) -> Array:
    rate = (time.size - 1) / (time[-1] - time[0])
    if rate <= 2.5 * NOISE_ABOVE or time.size < 50:
        return values
    sos = scipy.signal.butter(4, NOISE_ABOVE, output="sos", fs=rate)
    return np.asarray(scipy.signal.sosfiltfilt(sos, values, axis=0))


_QUANTILE = 2.326  # one-sided, 99 %


@dataclass(frozen=True)
class CorrectedError:
    """Error of predictions without the noise of what was measured."""

    noise: float  # root mean square of the measurement's noise [unit]
    error: float  # ``sqrt(max(0, e^2 - noise^2))``, with the root mean square e of the difference [unit]
    # of the measurements without their noise, ``error / sqrt(y^2 - noise^2)``; infinite where those are only noise
    relative: float
    # as `relative`, but what it is at least with a confidence of 99 %: noise is random, and known from one log
    least: float


def corrected_errors(
    measured: Array, predicted: Array, noise: MeasurementNoise
) -> tuple[tuple[CorrectedError, ...], CorrectedError]:
    """Corrected error of each equation, and that over all of them, in their units.

    Of the difference's power below the motion's highest frequency f, ``f S`` is noise of density S; of that above it,
    what the measurements have too. Only frequencies of the motion can show an error of the model, so that there is
    much less noise in them than in all.
    """  # measured, predicted (N, r)
    difference = measured - predicted
    error, size = np.mean(difference**2, axis=0), np.mean(measured**2, axis=0)
    fast = np.maximum(error - _slow_square(difference, noise), 0.0)
    square = noise.fast_share * fast + noise.above * noise.level
    parts = np.array([error, size, square, noise.slow_deviation**2, noise.level])
    whole = np.append(parts[:4].sum(axis=1), noise.level.max(initial=0.0))
    each, total = (tuple(_corrected(part, noise.duration) for part in one) for one in (parts.T, whole[None]))
    return each, total[0]


def _slow_square(x: Array, noise: MeasurementNoise) -> Array:
    """Mean square of what lies below the motion's highest frequency, by Parseval's theorem."""
    power = np.abs(np.fft.rfft(x, axis=0)) ** 2
    power[1 : (len(x) + 1) // 2] *= 2
    frequency = np.arange(len(power)) / noise.duration
    return np.asarray(power[frequency <= noise.above].sum(axis=0) / len(x) ** 2)


def _corrected(squares: Array, duration: float) -> CorrectedError:
    """From mean squares; `level / duration` is the noise in one frequency, with which an error of the model mixes."""
    error, size, noise, variance, level = squares.tolist()
    left, signal = max(error - noise, 0.0), max(size - noise, 0.0)
    chance = _QUANTILE * float(np.sqrt(variance + 2 * left * level / duration))
    return CorrectedError(
        float(np.sqrt(noise)),
        float(np.sqrt(left)),
        _root_ratio(left, signal),
        _root_ratio(max(left - chance, 0.0), signal + chance),
    )


def _root_ratio(part: float, whole: float) -> float:
    if whole > 0:
        return float(np.sqrt(part / whole))
    return np.inf if part > 0 else 0.0

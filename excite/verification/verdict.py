"""A verdict in words on a result, with its reasons."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from excite.verification.predicted_torques import CorrectedError, TorqueError
from excite.verification.simulated_motion import MotionError
from excite.verification.tolerances import Tolerances

MORE_THAN_TRAINING = 2.0
_NOISY = 0.9  # of the raw error: noise is mentioned where the error without it is less


@dataclass(frozen=True)
class Verdict:
    """Verdict on a result.

    Parameters
    ----------
    against : tuple of str
        Reasons against the result; empty if it holds.
    remarks : tuple of str
        Remarks that do not affect the verdict.
    """

    against: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def holds(self) -> bool:
        """True where nothing is against the result."""
        return not self.against

    @property
    def text(self) -> str:
        """One sentence."""
        if self.holds:
            return "The result predicts this log: you can rely on it for motions of this kind."
        return f"Do not rely on the result: {'; '.join(self.against)}."


def verdict(
    torques: Sequence[TorqueError],
    total: float,
    training: float | None,
    motions: Sequence[MotionError] | None,
    failed: str | None,
    tolerances: Tolerances,
    corrected: Sequence[CorrectedError] = (),
    corrected_total: CorrectedError | None = None,
) -> Verdict:
    """Judge the errors of a result, less the noise of the measurement where that is known."""
    whole = corrected_total if corrected_total is not None else without_noise(total)
    parts = corrected or [without_noise(t.relative, t.error) for t in torques]
    of_total, remarks = _of_total(whole, total, training, tolerances)
    against, noisy = list(of_total), list[str]()
    for t, part in zip(torques, parts, strict=True):
        if not part.least < 1.0:
            against.append(f"{t.name} is predicted no better than by zero torque ({100 * t.relative:.0f} %)")
        elif part.least > 2 * tolerances.torque:
            remarks.append(_poor(t, part))
        elif t.relative > 2 * tolerances.torque:
            noisy.append(f"{t.name} ({part.noise:.2g} {t.unit} of {t.measured:.2g} {t.unit})")
    if noisy:
        remarks.append(f"noise hides what this log could tell of {', '.join(noisy)}")
    if failed is not None:
        against.append(f"the simulated motion failed: {failed}")
    for m in motions or ():
        if math.isfinite(m.relative) and m.relative > tolerances.motion:
            against.append(
                f"the simulated motion of {m.name} deviates by {m.error:.3g} {m.unit}, {100 * m.relative:.0f} % of its "
                f"travel, more than {100 * tolerances.motion:g} %"
            )
    return Verdict(tuple(against), tuple(remarks))


def without_noise(relative: float, error: float = math.nan) -> CorrectedError:
    """An error of measurements without noise."""
    return CorrectedError(0.0, error, relative, relative)


def _of_total(
    whole: CorrectedError, total: float, training: float | None, tolerances: Tolerances
) -> tuple[list[str], list[str]]:
    """Reasons against the result by its error over all equations, and remarks on it."""
    against: list[str] = []
    remarks: list[str] = []
    noisy = whole.noise > 0 and whole.relative < _NOISY * total
    without = f", {100 * whole.relative:.2g} % without the noise of the measurement" if noisy else ""
    if not whole.least <= tolerances.torque:
        against.append(
            f"predictions differ from the measurements by {100 * total:.1f} %{without}, "
            f"more than {100 * tolerances.torque:g} %"
        )
    elif noisy and total > tolerances.torque:
        within = f"within {100 * whole.relative:.2g} %"
        if whole.relative > tolerances.torque:
            within = f"somewhere within {100 * whole.relative:.2g} %, which its noise leaves open"
        remarks.append(
            f"the measurements differ from the predictions by {100 * total:.0f} %, most of which is their own noise; "
            f"without it they are predicted {within}"
        )
    if training is not None and training > 0 and whole.least > MORE_THAN_TRAINING * training:
        text = (
            f"the error of {100 * whole.relative:.2g} % is {whole.relative / training:.3g} times that on the logs of "
            f"the identification ({100 * training:.2g} %)"
        )
        if whole.least > tolerances.torque / 2:
            against.append(f"{text}: the result does not generalise")
        else:
            remarks.append(f"{text}: this log is noisier, or its motion is of another kind")
    return against, remarks


def _poor(t: TorqueError, part: CorrectedError) -> str:
    without = f", {100 * part.relative:.0f} % without its noise" if part.relative < _NOISY * t.relative else ""
    return (
        f"{t.name} is predicted within {100 * t.relative:.0f} % only ({t.error:.2g} {t.unit} of "
        f"{t.measured:.2g} {t.unit}{without}), most of it from {t.limited_by}"
    )

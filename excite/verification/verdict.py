"""A verdict in words on a result, with its reasons."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from excite.verification.predicted_torques import TorqueError
from excite.verification.simulated_motion import MotionError
from regressors.errors import InputError

MORE_THAN_TRAINING = 2.0


@dataclass(frozen=True)
class Tolerances:
    """Largest errors of a result that holds.

    Parameters
    ----------
    torque : float
        Largest relative error over all equations.
    motion : float
        Largest error of the simulated motion of a joint, relative to its travel within a horizon.

    Raises
    ------
    InputError
        A tolerance that is not a positive number.
    """

    torque: float = 0.10
    motion: float = 0.25

    def __post_init__(self) -> None:
        for name in ("torque", "motion"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"`{name}_tolerance` must be a positive number of percent, given {100 * value:g}")


@dataclass(frozen=True)
class Verdict:
    """Verdict on a result.

    Parameters
    ----------
    holds : bool
    against : tuple of str
        Reasons against the result; empty if it holds.
    remarks : tuple of str
        Remarks that do not affect the verdict.
    """

    holds: bool
    against: tuple[str, ...]
    remarks: tuple[str, ...]

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
) -> Verdict:
    """Judge the errors of a result.

    Parameters
    ----------
    torques : sequence of TorqueError
    total : float
        Relative error over all equations.
    training : float, optional
        The same on the logs that the result was identified from, where known.
    motions : sequence of MotionError, optional
        None where no motion can be simulated.
    failed : str, optional
        Why the simulation of the motion ended early.
    tolerances : Tolerances
    """
    against: list[str] = []
    remarks: list[str] = []
    if not total <= tolerances.torque:
        against.append(
            f"predictions differ from the measurements by {100 * total:.1f} %, more than {100 * tolerances.torque:g} %"
        )
    if training is not None and training > 0 and total > MORE_THAN_TRAINING * training:
        text = (
            f"the error of {100 * total:.2g} % is {total / training:.3g} times that on the logs of the identification "
            f"({100 * training:.2g} %)"
        )
        if total > tolerances.torque / 2:
            against.append(f"{text}: the result does not generalise")
        else:
            remarks.append(f"{text}: this log is noisier, or its motion is of another kind")
    for t in torques:
        if not t.relative < 1.0:
            against.append(f"{t.name} is predicted no better than by zero torque ({100 * t.relative:.0f} %)")
        elif t.relative > 2 * tolerances.torque:
            remarks.append(
                f"{t.name} is predicted within {100 * t.relative:.0f} % only ({t.error:.2g} {t.unit} of "
                f"{t.measured:.2g} {t.unit}), most of it from {t.limited_by}"
            )
    if failed is not None:
        against.append(f"the simulated motion failed: {failed}")
    for m in motions or ():
        if math.isfinite(m.relative) and m.relative > tolerances.motion:
            against.append(
                f"the simulated motion of {m.name} deviates by {m.error:.3g} {m.unit}, {100 * m.relative:.0f} % of its "
                f"travel, more than {100 * tolerances.motion:g} %"
            )
    return Verdict(not against, tuple(against), tuple(remarks))

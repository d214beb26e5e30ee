"""Reference values of an estimate: the truth of simulated logs, or the robot's description."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from excite.information.target import IdentificationTarget
from excite.logs.log import Log
from regressors.models.nominal import parameter_values, standard_values
from regressors.samples import Array


@dataclass(frozen=True, eq=False)
class ReferenceValues:
    """Values that an estimate is compared with.

    Parameters
    ----------
    kind : {"truth", "description"}
        Of a simulated log, or as the robot's description states them.
    values : ndarray, shape (p,)
        NaN where unknown.
    """

    listed: ClassVar[bool] = True

    kind: str
    values: Array


def reference_of(target: IdentificationTarget, logs: Sequence[Log]) -> ReferenceValues:
    """True values of simulated logs, else those of the robot's description."""
    truths: list[Mapping[str, float]] = [log.truth for log in logs if log.truth]
    model, base = target.model, target.base
    if truths and len(truths) == len(logs) and all(truth == truths[0] for truth in truths):
        return ReferenceValues("truth", parameter_values(model, base, dict(truths[0])))
    return ReferenceValues("description", parameter_values(model, base, standard_values(target.robot)))

"""What repeats of an experiment are predicted to show of each parameter."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from excite.storage.records import check_replaceable, read_record, write_record
from excite.storage.result_folder import result_folder

KIND = "accuracy"


@dataclass(frozen=True)
class ParameterAccuracy:
    """Predicted accuracy of one parameter, in its unit.

    Parameters
    ----------
    name, unit : str
    value : float
        What repeats show on average.
    by_torques : float
        Standard deviation by noise of the torques.
    by_motion : float
        Root mean square error by noise and steps of the measured motion, about its mean.
    deviation : float
        Standard deviation of repeats, by both.
    bias : float or None
        Error that all repeats share, such as by friction that the model does not describe; None where the simulated
        robot has no such parameter.
    """

    beside: ClassVar[Mapping[str, Callable[[Any], Any]]] = {"error": lambda parameter: parameter.error}

    name: str
    unit: str
    value: float
    by_torques: float
    by_motion: float
    deviation: float
    bias: float | None

    @property
    def error(self) -> float:
        """Root mean square error, of deviation and bias together."""
        return float(np.hypot(self.deviation, self.bias or 0.0))


@dataclass(frozen=True)
class AccuracyPrediction:
    """Predicted accuracy of every parameter in repeats of one experiment.

    Parameters
    ----------
    name : str
        Of the design.
    robot, model : str
    parameters : tuple of ParameterAccuracy
    count : int
        Random samples that the deviations are computed from.
    seed : int
    conditions : mapping
        Stated noise and whatever else was simulated, as plain values.
    identification : mapping
        Settings of the identification, as plain values.
    notes : tuple of str
        What was chosen and assumed.
    design_sha256 : str
        Hash of the motion's coefficients.
    """

    beside: ClassVar[Mapping[str, Callable[[Any], Any]]] = {"precision": lambda prediction: prediction.precision}

    name: str
    robot: str
    model: str
    parameters: tuple[ParameterAccuracy, ...]
    count: int
    seed: int
    conditions: Mapping[str, Any] = field(default_factory=dict)
    identification: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    design_sha256: str = ""

    @property
    def precision(self) -> float:
        """Relative standard deviation of the predicted deviations themselves, ``1 / sqrt(2 (count - 1))``."""
        return float(1 / np.sqrt(2 * (self.count - 1)))

    def __repr__(self) -> str:
        """One-line summary."""
        return f"<AccuracyPrediction of {len(self.parameters)} parameters of {self.robot}, to {self.precision:.1%}>"

    def save(self, folder: str | Path) -> list[Path]:
        """Write ``accuracy.json`` into a folder, created if it does not exist; an older one is replaced.

        Parameters
        ----------
        folder : path

        Raises
        ------
        InputError
            The folder cannot be written to, or holds a file of the name that is no such prediction.
        """
        with result_folder(Path(folder)):
            check_replaceable(Path(folder), KIND, KIND)
            return write_record(self, KIND, Path(folder), KIND)


def load_accuracy(path: str | Path) -> AccuracyPrediction:
    """Load an ``accuracy.json``."""
    return read_record(Path(path), AccuracyPrediction, KIND)

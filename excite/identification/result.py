"""Interface of identification results, new or read from a file, for verification, simulation and comparison."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from excite.identification.recipe import Recipe
from excite.tasks.task import Task
from regressors.friction.curves import FrictionCurves
from regressors.robot.robot import Robot
from regressors.samples import Array


class IdentificationResult(ABC):
    """Result of an identification.

    Attributes
    ----------
    robot : Robot
        The whole robot.
    task : Task
        Which model, of which joints.
    recipe : Recipe
        With the chosen `sign_width` or `breakaway`.
    friction : FrictionCurves or None
        Known friction, subtracted from the torques.
    folder : Path or None
        Where it was read from.
    """

    robot: Robot
    task: Task
    recipe: Recipe
    friction: FrictionCurves | None
    folder: Path | None

    @property
    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """Names of the base parameters."""

    @property
    @abstractmethod
    def units(self) -> tuple[str, ...]:
        """Units of the base parameters."""

    @property
    @abstractmethod
    def coefficients(self) -> Array:
        """Values of the base parameters for predictions, shape (p,)."""

    @property
    @abstractmethod
    def training(self) -> frozenset[str]:
        """Hashes of the logs that it was identified from."""

    @property
    @abstractmethod
    def training_error(self) -> float | None:
        """Relative error of the predictions on those logs, at every instant, unfiltered."""

    @property
    def name(self) -> str:
        """Its folder, or the name of its robot."""
        return str(self.folder) if self.folder is not None else f"result for {self.robot.name}"

    def __repr__(self) -> str:
        """One line."""
        error = "" if self.training_error is None else f", training error {100 * self.training_error:.3g} %"
        return (
            f"<{type(self).__name__} of {self.robot.name}: {len(self.names)} parameters from {len(self.training)} "
            f"log(s){error}>"
        )


@dataclass(frozen=True, eq=False, repr=False)
class StoredResult(IdentificationResult):
    """A result read from its file.

    Parameters
    ----------
    folder : Path
    robot : Robot
        The whole robot.
    task : Task
    recipe : Recipe
    content : dict
        Content of the file.
    friction : FrictionCurves, optional
        Known friction, subtracted from the torques.
    """

    folder: Path
    robot: Robot
    task: Task
    recipe: Recipe
    content: Mapping[str, Any]
    friction: FrictionCurves | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the base parameters."""
        return tuple(str(parameter["name"]) for parameter in self.content["parameters"])

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the base parameters."""
        return tuple(str(parameter["unit"]) for parameter in self.content["parameters"])

    @cached_property
    def coefficients(self) -> Array:
        """Values of the base parameters for predictions, shape (p,)."""
        return np.array([float(parameter["fit"]) for parameter in self.content["parameters"]])

    @property
    def training(self) -> frozenset[str]:
        """Hashes of the logs that it was identified from."""
        return frozenset(log["sha256"] for log in self.content["logs"])

    @property
    def training_error(self) -> float | None:
        """Relative error of the predictions on those logs, at every instant, unfiltered."""
        value = self.content["prediction_error"]
        return None if value is None else float(value)

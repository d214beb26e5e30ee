"""Interface of the estimators: from observations, and the data behind them, to an estimate."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field

from excite.identification.estimate import Estimate
from excite.identification.observations import Observations
from excite.identification.preparation import PreparedLog
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget
from excite.trajectories import Trajectory


@dataclass(frozen=True, eq=False)
class Context:
    """Data that some estimators need besides the observations.

    Parameters
    ----------
    target : IdentificationTarget
    prepared : tuple of PreparedLog
        One per log.
    recipe : Recipe
    described : mapping of str to float
        Standard parameters as the robot's description states them.
    commanded : Trajectory, optional
        The motion that was played.
    """

    target: IdentificationTarget
    prepared: tuple[PreparedLog, ...]
    recipe: Recipe
    described: Mapping[str, float] = field(default_factory=dict)
    commanded: Trajectory | None = None


class Estimator(ABC):
    """Method that estimates beta from ``y = W beta + e``.

    An estimator of your own is a subclass with `estimate`, given as ``estimator=Mine()``.

    Attributes
    ----------
    name : str
        As on the command line.
    holds_rows : bool
        True if `estimate` needs W of the observations as an array; False if it reads them in slices, so that W may be
        larger than the memory.
    """

    name: str = "own"
    holds_rows: bool = True

    @abstractmethod
    def estimate(self, observations: Observations, context: Context | None = None) -> Estimate:
        """Estimate the parameters from observations.

        Parameters
        ----------
        observations : Observations
        context : Context, optional
            Data that they were computed from; not every estimator needs it.

        Raises
        ------
        InputError
            A required input is missing, or no estimate can be computed from the observations.
        """

    def check(self, commanded: Trajectory | None) -> None:
        """Raise `InputError`, before any log is read, if a required input is missing.

        Parameters
        ----------
        commanded : Trajectory or None
            The motion that was played, where it is known.
        """
        del commanded

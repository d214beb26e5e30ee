"""What an estimator is: from observations, and what they were made from, to an estimate."""

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
    """What some estimators need besides the observations.

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
    """A way from ``y = W beta + e`` to an estimate of beta.

    An estimator of your own is a subclass with `estimate`, given as ``estimator=Mine()``.

    Attributes
    ----------
    name : str
        As on the command line.
    """

    name: str = "own"

    @abstractmethod
    def estimate(self, observations: Observations, context: Context | None = None) -> Estimate:
        """Estimate of the parameters of some observations.

        Parameters
        ----------
        observations : Observations
        context : Context, optional
            What they were made from; not every estimator needs it.

        Raises
        ------
        InputError
            Something that is needed is missing, or observations that no estimate can be made of.
        """

    def check(self, commanded: Trajectory | None) -> None:
        """Raise `InputError`, before any log is read, where what is needed is not there.

        Parameters
        ----------
        commanded : Trajectory or None
            The motion that was played, where it is known.
        """
        del commanded

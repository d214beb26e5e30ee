"""What an estimator is given: the observations, and what they were made from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from excite.identification.estimate import Estimate
from excite.identification.observations import Observations
from excite.identification.preparation import Prepared
from excite.identification.recipe import Recipe
from excite.information.target import Subject

Estimator = Callable[[Observations, "Context"], Estimate]


@dataclass(frozen=True, eq=False)
class Context:
    """What some estimators need besides the observations.

    Parameters
    ----------
    subject : Subject
    prepared : tuple of Prepared
        One per log.
    recipe : Recipe
    """

    subject: Subject
    prepared: tuple[Prepared, ...]
    recipe: Recipe

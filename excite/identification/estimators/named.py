"""Estimators by name: one file each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from excite.identification.estimate import Estimate
from excite.registry import ESTIMATORS
from regressors.errors import UnknownName

DEFAULT = "weighted"


@dataclass(frozen=True)
class Estimator:
    """A registered estimator.

    Parameters
    ----------
    name : str
    module : str
        In this package; loaded when the estimator is first called.
    explanation : str
        One line.
    needs : tuple of str
        Arguments beside the observations, in their order.
    """

    name: str
    module: str
    explanation: str
    needs: tuple[str, ...] = ()

    def __call__(self, *arguments: Any, **settings: Any) -> Estimate:
        """Estimate from observations, and from what the estimator needs beside them."""
        function: Callable[..., Estimate] = getattr(
            import_module(f"excite.identification.estimators.{self.module}"), self.module
        )
        return function(*arguments, **settings)


_ESTIMATORS = (
    Estimator("huber", "huber", "weighted, and rows far from the rest count less"),
    Estimator(
        "instrumental", "instrumental", "instruments from a simulated motion, for noisy regressors", ("instruments",)
    ),
    Estimator("least-squares", "least_squares", "every row alike"),
    Estimator("physical", "physical", "weighted, over bodies and drives that can exist", ("model", "base")),
    Estimator("recursive", "recursive", "every row alike, with the estimate after every instant"),
    Estimator("total", "total", "weighted, with errors in the regressor as well"),
    Estimator("weighted", "weighted", "rows over the noise of their log and equation"),
)
_REGISTRY = {estimator.name: estimator for estimator in _ESTIMATORS}


def estimator(name: str = DEFAULT) -> Estimator:
    """Estimator of a name.

    Parameters
    ----------
    name : str
        One of `excite.registry.ESTIMATORS`.

    Raises
    ------
    UnknownName
        No such estimator.
    """
    if name not in _REGISTRY:
        raise UnknownName("estimator", name, ESTIMATORS)
    return _REGISTRY[name]

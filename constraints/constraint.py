"""The one form of every constraint: lower <= g(q, dq, ddq, dddq) <= upper, with labels and units.

A constraint depends on samples of a motion, never on the optimiser.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

from regressors.samples import Array, Samples

OTHER = "other"  # what a constraint limits, in a word, where it does not say


class Constraint(ABC):
    """A set of k bounds on functions of the motion.

    Attributes
    ----------
    labels : tuple of str
        Name of each function, such as ``joint q2 velocity``.
    units : tuple of str
    lower, upper : ndarray, shape (k,)
        Bounds; infinite where there is none.
    quantity : str
        What is limited, in a word, such as ``velocity``, ``torque`` or ``distance``.
    """

    labels: tuple[str, ...]
    units: tuple[str, ...]
    lower: Array
    upper: Array
    quantity: str = OTHER

    @abstractmethod
    def values(self, samples: Samples) -> Array:
        """Value of every function at every instant, shape (N, k)."""

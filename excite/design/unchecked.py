"""Limits that nothing is known of, so that a design cannot say whether its motion keeps them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from constraints.linear import LinearConstraint, spanned
from regressors.models.partial import PartialMotion


@dataclass(frozen=True)
class Unchecked:
    """A kind of limit that is not checked.

    Parameters
    ----------
    limit : str
        ``position``, ``velocity``, ``acceleration``, ``jerk``, ``torque``, ``self-collision`` or ``obstacles``.
    reason : str
        Why, with the joints where it is not all of them.
    """

    limit: str
    reason: str

    def __str__(self) -> str:
        return f"{self.limit} ({self.reason})"


def unchecked_limits(motion: PartialMotion, limits: Sequence[LinearConstraint]) -> tuple[Unchecked, ...]:
    """Limits of joints and drives that neither the robot's description nor the task states, but for torques.

    Parameters
    ----------
    motion : PartialMotion
    limits : sequence of LinearConstraint
        On the moving coordinates.
    """
    quantities = ("position", "velocity", "acceleration", "jerk")
    unchecked = []
    for derivative, quantity in enumerate(quantities):
        bounded = spanned(tuple(limits), len(motion.labels), (derivative,))
        free = [name for name, known in zip(motion.labels, bounded, strict=True) if not known]
        if free:
            of = "" if len(free) == len(motion.labels) else f" for {', '.join(free)}"
            unchecked.append(Unchecked(quantity, f"no limit is stated{of}"))
    return tuple(unchecked)


def kept_text(unchecked: Sequence[Unchecked]) -> str:
    """Verdict on a motion that exceeds no limit, with what was not checked.

    Parameters
    ----------
    unchecked : sequence of Unchecked
    """
    if not unchecked:
        return "every limit is kept"
    return f"every limit that was checked is kept; not checked: {', '.join(map(str, unchecked))}"

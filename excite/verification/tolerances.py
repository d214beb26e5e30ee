"""Tolerances of a verification: every setting of its verdict."""

from __future__ import annotations

from dataclasses import dataclass

from excite.tasks.option import essential
from regressors.arguments import checked
from regressors.quantities import check


@checked
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

    torque: float = essential(
        0.10,
        "percent",
        "Largest error of the torques, over all joints.",
        metavar="%",
        flag="torque-tolerance",
        quantity="torque_tolerance",
    )
    motion: float = essential(
        0.25,
        "percent",
        "Largest error of a joint's simulated motion.",
        metavar="%",
        flag="motion-tolerance",
        quantity="motion_tolerance",
    )

    def __post_init__(self) -> None:
        for name in ("torque", "motion"):
            check(f"{name}_tolerance", 100 * getattr(self, name))

"""How the inertia of a group of bodies that move as one is shared among its members.

Only the sum is identifiable. The members keep what their description says and the moving body takes the difference,
where that leaves it a physically possible body; else the others are scaled down until it does.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg

from regressors.robot.inertia import from_pseudo_inertia, pseudo_inertia
from regressors.samples import Array

_ROOM = 1e-6  # of the group's pseudo-inertia that the moving body must keep
_LISTED = 5
_PART = 0.5  # of the most that the others could have, where they are scaled


def own_part(group: Array, others: Sequence[tuple[Array, Array]]) -> tuple[Array, float]:
    """Parameters of the moving body, and the factor on those of the others.

    ``J_own = J_group - f sum_i T_i J_i T_i'`` with f = 1 or, where that leaves no possible body, ``1 / (2 lambda)``;
    lambda is the largest generalised eigenvalue of the others' pseudo-inertia and the group's.
    """  # group (10,); others (10,)
    J = pseudo_inertia(group)
    rest = sum((T @ pseudo_inertia(theta) @ T.T for theta, T in others), np.zeros((4, 4)))
    if not np.any(rest):
        return group, 1.0
    largest = float(scipy.linalg.eigh(rest, J, eigvals_only=True)[-1]) if np.linalg.eigvalsh(J)[0] > 0 else np.inf
    factor = 1.0 if largest <= 1.0 - _ROOM else _PART / largest
    return from_pseudo_inertia(J - factor * rest), factor


def held_note(link: str, others: Sequence[str], factor: float) -> str:
    """What to say of the bodies that moved with another one."""
    names = ", ".join(others[:_LISTED]) + (f" and {len(others) - _LISTED} more" if len(others) > _LISTED else "")
    if factor == 1.0:
        return (
            f"{names} did not move against {link}: they keep the inertia of their description, and {link} has the rest"
        )
    return (
        f"{names} did not move against {link}, and their described inertia would leave it no possible one: they have "
        f"{factor:.3g} of it, and {link} has the rest"
    )

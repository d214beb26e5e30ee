"""Bodies that are possible, but only just: as flat as a sheet or as thin as a rod."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from regressors.robot.inertia import pseudo_inertia
from regressors.samples import Array

_FLAT = 1e-5  # of the largest second moment of mass


def flat_bodies(bodies: Mapping[str, Array]) -> tuple[str, ...]:
    """Names of the bodies whose mass has almost no extent in some direction.

    The second moments of mass about the centre are the eigenvalues of ``J_xx - m c c'``, with the pseudo-inertia
    ``J``; a body is flat where the smallest is below 1e-5 of the largest: a sheet of 1 m by 3 mm.
    """  # bodies (10,)
    return tuple(name for name, theta in bodies.items() if theta[0] > 0 and _flat(pseudo_inertia(theta)))


def _flat(J: Array) -> bool:
    moments = np.linalg.eigvalsh(J[:3, :3] - np.outer(J[:3, 3], J[:3, 3]) / J[3, 3])
    return bool(moments[0] < _FLAT * moments[-1])


def flat_note(bodies: Mapping[str, Array]) -> tuple[str, ...]:
    """A note that names them; none where there are none."""
    names = ", ".join(flat_bodies(bodies))
    return (
        (
            f"the identified parameters leave {names} only just possible, as flat as a sheet or as thin as a rod: "
            "simulators may need shorter steps; an identification with `estimator='physical'` and "
            "`described_within=0.5` keeps all bodies near the description",
        )
        if names
        else ()
    )

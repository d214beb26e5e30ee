"""A load at the last link that nobody told of, by the torques that it explains.

What a load of ten parameters phi adds to the joint torques is linear in them, ``K phi`` [KD96] eq. (8)-(10). Torques
that a rigid load explains far better than nothing does, with a mass and a centre as loads have them, are named as its
own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regressors.errors import percent
from regressors.models.load import PayloadModel
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

_INSTANTS = 1500
_ROUNDS = 3  # of weights by the residuals
_LEAST = 0.02  # of the torque: less is not searched for a load
_EXPLAINED = 0.4  # of the differences that may be left
_FARTHEST = 1.0  # from the last link's frame to the centre of mass [m]
_LIGHTEST = 0.05  # [kg]


@dataclass(frozen=True)
class UntoldLoad:
    """A load at the last link that explains a difference of torques."""

    mass: float  # [kg]; negative where the load is missing
    centre: tuple[float, float, float]  # of mass, in the last link's frame [m]
    before: float  # size of the differences over the torques
    after: float  # of what it leaves

    @property
    def text(self) -> str:
        """Its mass and place, and how much it explains."""
        place = ", ".join(f"{x:.3f}" for x in self.centre)
        return (
            f"a load of {abs(self.mass):.3g} kg at the last link, its centre at ({place}) m, would explain all but "
            f"{percent(self.after)} of {percent(self.before)}"
        )


def load_that_explains(robot: Robot, motion: Samples, difference: Array, measured: Array) -> UntoldLoad | None:
    """The load that explains most of a difference of joint torques, if one explains most of it."""
    # difference, measured (N, n)
    size = float(np.linalg.norm(measured))
    before = float(np.linalg.norm(difference)) / size if size > 0 else 0.0
    if not _LEAST < before < np.inf:
        return None
    some = np.unique(np.linspace(0, len(difference) - 1, _INSTANTS).astype(int))
    K = PayloadModel(robot).instants(motion.rows(some)).reshape(some.size, robot.n, -1)
    y = difference[some]
    deviation = np.sqrt(np.mean(y**2, axis=0))
    phi = np.zeros(K.shape[2])
    for _ in range(_ROUNDS):
        weight = 1 / np.maximum(deviation, 1e-3 * deviation.max())
        phi = np.linalg.lstsq((K * weight[:, None]).reshape(-1, phi.size), (y * weight).ravel(), rcond=1e-8)[0]
        deviation = np.sqrt(np.mean((y - K @ phi) ** 2, axis=0))
    after = float(np.linalg.norm(y - K @ phi) / np.linalg.norm(measured[some]))
    mass, *moment = phi[:4].tolist()
    centre = (moment[0] / mass, moment[1] / mass, moment[2] / mass) if mass else (np.inf,) * 3
    if not (after < _EXPLAINED * before and abs(mass) > _LIGHTEST and np.linalg.norm(centre) < _FARTHEST):
        return None
    return UntoldLoad(mass, centre, before, after)

"""Rigid bodies and rotors: the regressor of all standard parameters, and which of its columns are independent."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from regressors.models.differential import DifferentialModel
from regressors.models.nominal import standard_values
from regressors.robot.columns import Terms
from regressors.robot.robot import Robot
from regressors.samples import Samples

Array = NDArray[np.float64]
STATES = 400


class RigidRegressor:
    """Ten columns of every link by the package's model, then the acceleration of each joint for its rotor.

    Parameters
    ----------
    robot : Robot
        A chain whose drives act on one joint each.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._model = DifferentialModel(robot, Terms.inertial_only())
        known = standard_values(robot)
        bodies = [known.get(column.name, 0.0) for column in self._model.columns]
        self.described = np.array([*bodies, *np.zeros(robot.n)])

    def columns(self, samples: Samples) -> Array:
        """Shape (N, n, 10 n + n)."""
        N, n = samples.q.shape
        rotors = samples.ddq[:, :, None] * np.eye(n)
        return np.concatenate([self._model.instants(samples).reshape(N, n, -1), rotors], axis=2)

    @cached_property
    def independent(self) -> NDArray[np.intp]:
        """Columns that are independent of those to their left, at random states."""
        q, dq, ddq = np.random.default_rng(0).uniform(-3, 3, (3, STATES, self.robot.n))
        W = self.columns(Samples(np.arange(float(STATES)), q, dq, ddq, np.zeros_like(q)))
        W = W.reshape(-1, W.shape[2])
        size = np.linalg.norm(W, axis=0)
        scale = np.where(size > 1e-9 * size.max(), size, np.inf)  # what is zero but for rounding stays zero
        R = scipy.linalg.qr(W / scale, mode="r")[0][: W.shape[1]]
        kept: list[int] = []
        for k in range(W.shape[1]):  # what is left of a column beside those kept so far
            left = R[:, k] - R[:, kept] @ np.linalg.lstsq(R[:, kept], R[:, k], rcond=None)[0] if kept else R[:, k]
            if np.linalg.norm(left) > 1e-8:
                kept.append(k)
        return np.array(kept)

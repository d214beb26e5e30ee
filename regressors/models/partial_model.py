"""A torque model as a partial motion sees it."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from regressors.errors import InputError, UnknownName
from regressors.models.model import RegressorModel
from regressors.models.partial import PartialMotion
from regressors.models.torque_equations import TorqueEquations
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples
from regressors.symbolic.kinematics import sparse


def _index(name: str, labels: Sequence[str], numbers: Sequence[str]) -> int:
    for names in (labels, numbers):
        if name in names:
            return names.index(name)
    raise UnknownName("equation", name, (f"{k} ({label})" for k, label in zip(numbers, labels, strict=True)))


class PartialModel(RegressorModel):
    """A torque model seen by the moving coordinates alone, ``N' Y``.

    Held joints and drives are left out: what they carry while at rest is lost in static friction.

    Parameters
    ----------
    model : RegressorModel
        One row per joint.
    motion : PartialMotion
    equations : sequence of str, optional
        Moving coordinates whose torques are used, by label or number; all of them if not given.

    Raises
    ------
    InputError
        The model is not of the torques of the motion's joints, one row each.
    UnknownName
        No such coordinate.
    """

    jax_form = "regressors.jax_models.jax_differential:ProjectedPart"

    def __init__(self, model: RegressorModel, motion: PartialMotion, equations: Sequence[str] | None = None) -> None:
        if not model.rows_are_joint_torques or len(model.row_labels) != len(motion.offset):
            raise InputError(
                f"a partial motion of {len(motion.offset)} joints needs a model of their torques, one row per joint, "
                f"given {type(model).__name__} with {len(model.row_labels)}"
            )
        self.model, self.motion = model, motion
        self.robot, self.columns, self.reduction = model.robot, model.columns, model.composition
        numbers = [str(k) for k in range(1, len(motion.labels) + 1)]
        self.used = sorted({_index(equation, motion.labels, numbers) for equation in equations or motion.labels})
        torque = {"rad": "Nm", "m": "N"}
        self.row_labels = tuple((motion.labels[k], torque[motion.units[k]]) for k in self.used)

    def rows(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        """Rows of the moving coordinates that are used, shape (r, p)."""
        return ca.mtimes(sparse(self.motion.matrix.T[self.used]), self.model.rows(q, dq, ddq))

    def right_side(self, samples: Samples, measured: Array) -> Array:
        """Torques of the moving coordinates that are used, ``N' tau``; `measured` has shape (N, n) [Nm or N]."""
        torque = np.asarray(measured, dtype=float) @ self.motion.matrix[:, self.used]
        return np.asarray(torque.reshape(-1))

    def torque_equations(self) -> TorqueEquations:
        """Those of the moving coordinates that are used."""
        return TorqueEquations(self.model, self.motion, tuple(self.used))

    def restricted(self, motion: PartialMotion, equations: Sequence[str] | None = None) -> RegressorModel:
        """The whole model as another motion of the same joints sees it."""
        return self.model.restricted(motion, equations)

    def on(self, robot: Robot) -> PartialModel:
        """The same motion of another form of the robot with the same joints."""
        return self._around(self.model.on(robot))

    def softened(self, sign_width: float) -> PartialModel:
        """The whole model softened, seen by the same motion."""
        return self._around(self.model.softened(sign_width))

    def instantaneous(self) -> PartialModel:
        """The whole model at single instants, seen by the same motion."""
        return self._around(self.model.instantaneous())

    def _around(self, model: RegressorModel) -> PartialModel:
        if model is self.model:
            return self
        return PartialModel(model, self.motion, [self.motion.labels[k] for k in self.used])

"""Error of the torques that identified parameters predict along a stated task motion.

With the covariance C of the parameters, the root mean square error of the torque of a joint i along N instants is
``sqrt(tr(C G_i))``, with ``G_i = Y_i' Y_i / N`` of the rows Y_i of that joint.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from excite.information.prior import prior_of
from excite.information.target import IdentificationTarget
from excite.tasks.precision_target import TaskTorques
from regressors.errors import InputError
from regressors.samples import Array, Samples


@dataclass(frozen=True, eq=False)
class TorquePrecision:
    """Torques along a task motion, and how well they are to be predicted."""

    names: tuple[str, ...]  # of the joints' torques
    units: tuple[str, ...]
    rows: Array  # (r, N, b) Y of every equation, over the root of N
    allowed: Array  # (r,) largest half-width of each root mean square error [Nm or N]

    def deviations(self, half: Array) -> Array:
        """Root mean square error of each torque, for a factor ``C = half half'``, shape (r,)."""
        return np.asarray(np.linalg.norm(self.rows @ half, axis=(1, 2)))

    @property
    def information(self) -> Array:
        """Sum of ``G_i`` over the squared allowed error, shape (b, b)."""
        scaled = (self.rows / self.allowed[:, None, None]).reshape(-1, self.rows.shape[2])
        return np.asarray(scaled.T @ scaled)


def torque_precision(torques: TaskTorques, target: IdentificationTarget) -> TorquePrecision:
    """The torques of a task motion in the base columns of a target.

    Described parameters state the torque that shares are taken of; friction that is not described counts as none.
    """
    motion, names = torques.motion, target.robot.joint_names
    missing = [name for name in names if name not in motion.joints]
    if missing:
        raise InputError(f"precision: the task motion does not state {', '.join(missing)}, which move")
    if target.model.window is not None:
        raise InputError(
            "precision: torques along a task motion need a model of single instants, `model='differential'`"
        )
    place = [motion.joints.index(name) for name in names]
    q, dq, ddq = (np.array(part)[:, place] for part in (motion.q, motion.dq, motion.ddq))
    samples = Samples(np.arange(float(len(q))), q, dq, ddq, np.zeros_like(q))
    r, base = len(target.model.row_labels), target.base
    Y = target.model.instants(samples)[:, base.index].reshape(len(q), r, -1).transpose(1, 0, 2) / np.sqrt(len(q))
    values = np.nan_to_num(prior_of(target.model, base, None).base_values(np.eye(base.rank)))
    size = np.linalg.norm(Y @ values, axis=1)
    labels = [name for name, _ in target.model.row_labels]
    if not np.all(size > 0.0):
        still = ", ".join(label for label, each in zip(labels, size, strict=True) if not each > 0.0)
        raise InputError(f"precision: the described torque of {still} is zero along the task motion")
    units = tuple(unit for _, unit in target.model.row_labels)
    return TorquePrecision(tuple(f"torque {label}" for label in labels), units, Y, torques.share * size)

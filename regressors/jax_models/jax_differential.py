"""JAX form of the differential model [KD96] eq. (3), (21), and of its restriction to a partial motion."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from regressors.friction.friction_drives import torques_at_drives
from regressors.jax_models.jax_bodies import torque_regressor
from regressors.jax_models.jax_drives import drives_of
from regressors.jax_models.part import RegressorBlock, part_of, reduced
from regressors.jax_models.tree import tree_motion, tree_of
from regressors.models.carried_torque import carried_rotors
from regressors.models.differential import DifferentialModel
from regressors.models.model import PartialModel
from regressors.samples import Index


class DifferentialPart(RegressorBlock):
    """Joint torques per parameter."""  # columns (p,)

    def __init__(self, model: DifferentialModel, columns: Index) -> None:
        self._tree = tree_of(model.robot)
        self._drives = drives_of(model.robot, model.terms, model.sign_width)
        self._S = model.reduction.matrix[:, columns]
        self._bodies = None
        if model.carried_bodies is not None:
            self._bodies = model.carried_bodies.reshape(-1)
            self._to_drives = torques_at_drives(model.robot)
            inertias = carried_rotors(model.robot, model.carried)
            self._rotors = np.array([inertias[self._drives.numbers[k]] for k in self._drives.rotors])

    def rows(self, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> jax.Array:
        """``tau = Y p``, shape (n, p, L)."""
        inertial = torque_regressor(self._tree, tree_motion(self._tree, q, dq, ddq))
        drives = self._drives.torque_columns(q, dq, ddq, self._carried(inertial, q, dq, ddq))
        return reduced(jnp.concatenate([inertial, *drives], axis=1), self._S)

    def _carried(self, inertial: jax.Array, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> jax.Array | None:
        """Torque that each drive carries, shape (m, L); None where no load share is a parameter."""
        if self._bodies is None:
            return None
        of_bodies = jnp.einsum("npl,p->nl", inertial, jnp.asarray(self._bodies))
        carried = jnp.asarray(self._to_drives) @ of_bodies
        if not self._drives.rotors.size:
            return carried
        rotors = self._rotors[:, None] * self._drives.rotor_torques(q, dq, ddq)
        return carried.at[self._drives.rotors].add(rotors)


class ProjectedPart(RegressorBlock):
    """Linear combinations of another model's rows, ``N' Y``."""  # columns (p,)

    def __init__(self, model: PartialModel, columns: Index) -> None:
        self._whole = part_of(model.model, columns)
        self._projection = model.torque_equations().directions.T

    def rows(self, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> jax.Array:
        """Rows of the moving coordinates, shape (r, p, L)."""
        return jnp.tensordot(jnp.asarray(self._projection), self._whole.rows(q, dq, ddq), axes=1)

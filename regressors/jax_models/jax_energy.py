"""JAX form of the energy-integral model [KD96] eq. (4)-(7), (19)."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from regressors.jax_models.integrals import path_lengths
from regressors.jax_models.jax_bodies import energy_regressor
from regressors.jax_models.jax_drives import drives_of
from regressors.jax_models.part import WindowPart, reduced, spacing
from regressors.jax_models.tree import tree_motion, tree_of
from regressors.models.columns import COULOMB
from regressors.models.energy import EnergyModel
from regressors.samples import Array, Index


class EnergyPart(WindowPart):
    """Work of the joint torques per parameter."""  # columns (p,)

    def __init__(self, model: EnergyModel, columns: Index) -> None:
        self.window = model.window
        self._tree = tree_of(model.robot)
        self._drives = drives_of(model.robot, model.terms, model.sign_width)
        self._S = model.reduction.matrix[:, columns]
        self._inertial = 10 * len(self._tree.parent)
        place = self._drives.coulomb_columns
        self._spread = self._S[self._inertial + place.start : self._inertial + place.stop]

    def state(self, q: jax.Array, dq: jax.Array) -> jax.Array:
        """Energy, shape (1, p, L)."""
        links = energy_regressor(self._tree, tree_motion(self._tree, q, dq, jnp.zeros_like(q)))
        return reduced(jnp.concatenate([links, *self._drives.energy_columns(q, dq)], axis=1), self._S)

    def density(self, q: jax.Array, dq: jax.Array) -> jax.Array:
        """Power lost by friction, shape (1, p, L)."""
        links = jnp.zeros((1, self._inertial, q.shape[-1]))
        return reduced(jnp.concatenate([links, *self._drives.loss_columns(dq)], axis=1), self._S)

    def measured_density(self, dq: jax.Array, measured: jax.Array) -> jax.Array:
        """Power of the joint torques, ``tau' dq``, shape (N, 1) [W]; `measured` has shape (N, n)."""
        return jnp.sum(measured * dq.T, axis=1, keepdims=True)

    def cumulated(self, time: Array, q: jax.Array, dq: jax.Array) -> jax.Array:
        """As for any window model, but Coulomb losses of exact sign come from the drives' path lengths."""
        cumulated = super().cumulated(time, q, dq)
        columns = np.flatnonzero(np.any(self._spread != 0.0, axis=0))
        if self._drives.sign_width > 0.0 or not columns.size:
            return cumulated
        C = jnp.asarray(self._drives.coupling[self._drives.of_kind(COULOMB)])
        paths = path_lengths((C @ q).T, (C @ dq).T, spacing(time)) @ jnp.asarray(self._spread[:, columns])
        return cumulated.at[:, 0, columns].set(paths)

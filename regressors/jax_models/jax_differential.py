"""Counterpart of the differential model [KD96] eq. (3), (21), and of a partial motion's view of it."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from regressors.jax_models.jax_bodies import torque_regressor
from regressors.jax_models.jax_drives import drives_of
from regressors.jax_models.part import Part, reduced
from regressors.jax_models.tree import tree_motion, tree_of
from regressors.models.differential import DifferentialModel
from regressors.samples import Array


class DifferentialPart(Part):
    """Joint torques per parameter.

    Parameters
    ----------
    model : DifferentialModel
    S : ndarray, shape (standard parameters, p)
        Columns to be had, in terms of the standard ones.
    """

    def __init__(self, model: DifferentialModel, S: Array) -> None:
        self._tree = tree_of(model.robot)
        self._drives = drives_of(model.robot, model.terms, model.sign_width)
        self._S = S

    def rows(self, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> jax.Array:
        """``tau = Y p``, shape (n, p, L)."""
        inertial = torque_regressor(self._tree, tree_motion(self._tree, q, dq, ddq))
        drives = self._drives.torque_columns(q, dq, ddq)
        return reduced(jnp.concatenate([inertial, *drives], axis=1), self._S)


class ProjectedPart(Part):
    """Some combinations of another model's rows, ``N' Y``.

    Parameters
    ----------
    whole : Part
    projection : ndarray, shape (r, n)
    """

    def __init__(self, whole: Part, projection: Array) -> None:
        self._whole, self._projection = whole, projection

    def rows(self, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> jax.Array:
        """Rows of the moving coordinates, shape (r, p, L)."""
        return jnp.tensordot(jnp.asarray(self._projection), self._whole.rows(q, dq, ddq), axes=1)

"""The JAX form of a model: the same columns and rows, for batches of motions."""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from regressors.errors import InputError
from regressors.jax_models.part import part_of
from regressors.models.model import RegressorModel
from regressors.samples import Array, Index


class JaxModel:
    """Regressor of a model as a pure function of batches, to be compiled, mapped and differentiated by JAX."""

    def __init__(self, model: RegressorModel, columns: Index | None = None) -> None:
        chosen = np.arange(len(model.columns)) if columns is None else np.asarray(columns)
        self.names = tuple(model.names[k] for k in chosen)
        self.n, self.equations = model.robot.n, len(model.row_labels)
        self._part = part_of(model, chosen)

    def rows(self, q: jax.Array | Array, dq: jax.Array | Array, ddq: jax.Array | Array) -> jax.Array:
        """Regressor of single instants, as the model's `rows`."""  # q, dq, ddq (..., n)
        motion = self._checked(q, dq, ddq)
        lead = motion[0].shape[:-1]
        values = self._part.rows(*(x.reshape(-1, self.n).T for x in motion))
        return jnp.moveaxis(values, -1, 0).reshape(*lead, self.equations, len(self.names))

    def assemble(self, time: Array, q: jax.Array | Array, dq: jax.Array | Array, ddq: jax.Array | Array) -> jax.Array:
        """Regressor of whole motions, as the model's `assemble`: one block of rows per instant, or per window."""
        # time (N,); q, dq, ddq (..., N, n)
        q, dq, ddq = self._checked(q, dq, ddq)
        return _over_motions(lambda *x: self._part.assembled(time, *(y.T for y in x)), q, dq, ddq)

    def right_side(
        self, time: Array, q: jax.Array | Array, dq: jax.Array | Array, measured: jax.Array | Array
    ) -> jax.Array:
        """Measured vector y of whole motions, as the model's `right_side`."""
        # time (N,); q, dq (..., N, n); measured (..., N, channels)
        q, dq = self._checked(q, dq)
        y = jnp.asarray(measured)
        return _over_motions(lambda q, dq, y: self._part.right_side(time, q.T, dq.T, y), q, dq, y)

    def _checked(self, *motion: jax.Array | Array) -> list[jax.Array]:
        if jnp.result_type(float) != jnp.float64:
            raise InputError(
                "the JAX form of a model needs 64-bit numbers: call it within `with jax.enable_x64(True):`"
            )
        for x in motion:
            if x.ndim < 1 or x.shape[-1] != self.n or x.shape != motion[0].shape:
                shapes = ", ".join(str(x.shape) for x in motion)
                raise InputError(
                    f"motion of {self.n} joints: expected arrays of one shape (..., {self.n}), given {shapes}"
                )
        return [jnp.asarray(x) for x in motion]


def _over_motions(function: Callable[..., jax.Array], *arrays: jax.Array) -> jax.Array:
    """Map a function of one motion's arrays, shape (N, ...) each, over the leading axes."""
    lead = arrays[0].shape[:-2]
    values = jax.vmap(function)(*(x.reshape(-1, *x.shape[-2:]) for x in arrays))
    return values.reshape(*lead, *values.shape[1:])

"""Base classes of the JAX forms: rows at single instants, with instants along the last axis, and over windows."""

from __future__ import annotations

from abc import ABC, abstractmethod
from importlib import import_module

import jax
import jax.numpy as jnp
import numpy as np

from regressors.errors import InputError
from regressors.jax_models.integrals import running_integral
from regressors.models.model import RegressorModel
from regressors.models.windows import Window
from regressors.samples import Array, Index


class RegressorBlock(ABC):
    """JAX form of a model of single instants."""  # columns (p,)

    @abstractmethod
    def __init__(self, model: RegressorModel, columns: Index) -> None: ...

    @abstractmethod
    def rows(self, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> jax.Array:
        """Regressor of L instants, shape (r, p, L); `q`, `dq`, `ddq` have shape (n, L)."""

    def assembled(self, time: Array, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> jax.Array:
        """Regressor of one motion of N instants, shape (m, r, p); `time` has shape (N,), the motion (n, N)."""
        return jnp.moveaxis(self.rows(q, dq, ddq), -1, 0)

    def right_side(self, time: Array, q: jax.Array, dq: jax.Array, measured: jax.Array) -> jax.Array:
        """Measured vector y, shape (m, r), from the channels, shape (N, channels); the motion has shape (n, N)."""
        return measured


def part_of(model: RegressorModel, columns: Index) -> RegressorBlock:
    """JAX form of a model, from the class that `RegressorModel.jax_form` names."""  # columns (p,)
    if model.jax_form is None:
        raise InputError(f"{type(model).__name__} has no JAX form: its class names none as jax_form, 'module:Class'")
    module, _, name = model.jax_form.partition(":")
    part: RegressorBlock = getattr(import_module(module), name)(model, columns)
    return part


class WindowPart(RegressorBlock):
    """JAX form of a model over time windows, those of its attribute `window`."""

    window: Window

    @abstractmethod
    def state(self, q: jax.Array, dq: jax.Array) -> jax.Array:
        """State whose difference over a window counts, shape (r, p, L)."""

    @abstractmethod
    def density(self, q: jax.Array, dq: jax.Array) -> jax.Array:
        """Density whose integral over a window counts, shape (r, p, L)."""

    @abstractmethod
    def measured_density(self, dq: jax.Array, measured: jax.Array) -> jax.Array:
        """Measured density whose integral over a window is y, shape (N, r)."""

    def rows(self, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> jax.Array:
        """``d/dt state + density``."""
        rate: jax.Array = jax.jvp(self.state, (q, dq), (dq, ddq))[1]
        return rate + self.density(q, dq)

    def cumulated(self, time: Array, q: jax.Array, dq: jax.Array) -> jax.Array:
        """``state(t) + int density`` from the first sample on, shape (N, r, p)."""
        state, density = (jnp.moveaxis(f(q, dq), -1, 0) for f in (self.state, self.density))
        return state + running_integral(density, spacing(time))

    def assembled(self, time: Array, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> jax.Array:
        """One row per window and equation, shape (windows, r, p)."""
        return self._differences(time, self.cumulated(time, q, dq))

    def right_side(self, time: Array, q: jax.Array, dq: jax.Array, measured: jax.Array) -> jax.Array:
        """Integrals over the windows, shape (windows, r)."""
        return self._differences(time, running_integral(self.measured_density(dq, measured), spacing(time)))

    def _differences(self, time: Array, cumulated: jax.Array) -> jax.Array:
        first, last = self.window.ends(time)
        return cumulated[last] - cumulated[first]


def spacing(time: Array) -> float:
    """Sample time of uniform samples [s]."""
    return float(time[-1] - time[0]) / (time.size - 1)


def reduced(Y: jax.Array, S: Array) -> jax.Array:
    """``Y S`` at every instant, shape (r, p, L); by indexing where S only selects columns."""  # Y (r, P, L); S (P, p)
    if np.all(np.count_nonzero(S, axis=0) == 1) and np.all(S.sum(axis=0) == 1.0):
        return Y[:, np.argmax(S, axis=0)]
    used = np.flatnonzero(np.any(S != 0.0, axis=1))
    return jnp.moveaxis(jnp.tensordot(jnp.asarray(S[used]), Y[:, used], axes=(0, 1)), 0, 1)

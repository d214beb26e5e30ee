"""The JAX form of a model, and its parts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from importlib import import_module

import jax
import jax.numpy as jnp
import numpy as np

from regressors.errors import InputError
from regressors.jax_models.jax_drives import running_integral
from regressors.models.model import RegressorModel
from regressors.models.windows import Window
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

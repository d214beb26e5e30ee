"""The moments of many repetitions at once by JAX, on a GPU."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, cached_property
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any

import numpy as np

from excite.study.moment_sums import EquationColumns, MomentSums
from regressors.samples import Array, Samples

if TYPE_CHECKING:
    import jax


_AT_ONCE = 3e7  # numbers of the rows of a batch, 0.24 GB, of which the device holds several copies
_MOST = 64  # repetitions of a batch


@cache
def has_gpu() -> bool:
    """Whether JAX computes on a GPU here; without a plug-in for one JAX is not even imported."""
    if not entry_points(group="jax_plugins"):
        return False
    try:
        import jax

        return bool(jax.default_backend() == "gpu")
    except (ImportError, RuntimeError):
        return False


class JaxMoments:
    """`MomentSums.of` for batches of repetitions."""

    def __init__(self, sums: MomentSums, columns: EquationColumns) -> None:
        from regressors.jax_models import JaxModel

        self._sums, self._columns = sums, columns
        self._model = JaxModel(columns.model, columns.index)

    @classmethod
    def of(cls, sums: MomentSums, columns: EquationColumns) -> JaxMoments | None:
        """These moments; None for models and equations that JAX does not compute."""
        if columns.model.jax_form is None or columns.decimation is not None:
            return None
        return cls(sums, columns)

    def batch(self, instants: int) -> int:
        """Repetitions whose rows fit at once."""
        width = len(self._columns.used) * self._sums.size
        return max(1, min(_MOST, int(_AT_ONCE / (instants * width))))

    def __call__(self, measured: Sequence[tuple[Samples, Array]]) -> Array:
        """Moments of each repetition, shape (R, r, k, k), from its motion and its left-hand sides."""
        import jax

        time = measured[0][0].time
        whole = [*measured, *[measured[-1]] * (self.batch(time.size) - len(measured))]  # of one size: compiled once
        motion = (np.stack([getattr(samples, name) for samples, _ in whole]) for name in ("q", "dq", "ddq"))
        with jax.enable_x64(True):
            y = np.stack([y for _, y in whole])
            G = self._compiled(tuple(time.tolist()), *motion, y, self._instruments)
            return np.asarray(G)[: len(measured)]

    @cached_property
    def _compiled(self) -> Any:
        import jax

        return jax.jit(self._moments, static_argnums=0)

    def _moments(self, time: tuple[float, ...], *arrays: jax.Array) -> jax.Array:
        """Of the batch's q, dq, ddq and y, and of the instruments."""
        import jax.numpy as jnp

        *motion, y, instruments = arrays
        W = self._model.assemble(np.array(time), *motion)
        e = y - W @ jnp.asarray(self._sums.beta)
        A = W if self._sums.change is None else W @ jnp.asarray(self._sums.change)
        A = jnp.concatenate([A, e[..., None]], axis=-1)
        if self._sums.instruments is not None:
            Z = jnp.broadcast_to(instruments, (*A.shape[:-1], self._sums.beta.size))
            A = jnp.concatenate([Z, A], axis=-1)
        return jnp.einsum("tmri,tmrj->trij", A, A)

    @cached_property
    def _instruments(self) -> Array:
        """Columns ``Z P`` of the instruments, shape (m, r, b); empty without any."""
        if self._sums.instruments is None:
            return np.zeros((0, 0, 0))
        rows = self._sums.instruments[0].shape[1]
        Z = np.zeros((rows, len(self._sums.used), self._sums.beta.size))
        for j, (x, used) in enumerate(zip(self._sums.instruments, self._sums.used, strict=True)):
            Z[:, j, used] = x.T
        return Z if self._sums.change is None else Z @ self._sums.change

"""JAX forms of the load models: the wrench at a sensor, and its integrals [KD96] eq. (8)-(13)."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from regressors.jax_models.jax_bodies import effort, momentum
from regressors.jax_models.part import RegressorBlock, WindowPart, reduced
from regressors.jax_models.tree import tree_motion, tree_of
from regressors.jax_models.vectors import cross
from regressors.models.load import EQUATIONS, LoadIntegralModel, LoadModel, Sensor
from regressors.robot.robot import Robot
from regressors.samples import Array, Index


class _SensorFrame:
    """Motion of the sensor's frame, and the directions of the equations."""

    def __init__(self, robot: Robot, sensor: Sensor) -> None:
        self._tree, self._link = tree_of(robot), sensor.place(robot)
        self._Rt, self._p = np.asarray(sensor.rotation).T, np.asarray(sensor.translation)[:, None]
        directions = np.eye(6)[[EQUATIONS.index(name) for name in sensor.equations]]
        self.l: Array = directions[:, :3, None]
        self.s: Array = directions[:, 3:, None]

    def motion(self, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> tuple[jax.Array, ...]:
        """``omega, domega, v, a, up`` in the sensor's axes, shape (3, L) each, as in `TreeMotion`."""
        m, k = tree_motion(self._tree, q, dq, ddq), self._link
        w, dw, p = m.omega[k], m.domega[k], jnp.broadcast_to(self._p, m.omega[k].shape)
        v, a = m.v[k] + cross(w, p), m.a[k] + cross(dw, p) + cross(w, cross(w, p))
        return tuple(jnp.asarray(self._Rt) @ x for x in (w, dw, v, a, m.up[k]))


class LoadPart(RegressorBlock):
    """Wrench at the sensor per parameter."""  # columns (p,)

    def __init__(self, model: LoadModel, columns: Index) -> None:
        self._frame, self._S = _SensorFrame(model.robot, model.sensor), np.eye(len(model.columns))[:, columns]
        self._equations = [EQUATIONS.index(name) for name in model.sensor.equations]

    def rows(self, q: jax.Array, dq: jax.Array, ddq: jax.Array) -> jax.Array:
        """Selected rows of K, shape (r, p, L)."""
        w, dw, _, a, _ = self._frame.motion(q, dq, ddq)
        return reduced(effort(*_directed(self._frame, w, dw, a)), self._S)

    def right_side(self, time: Array, q: jax.Array, dq: jax.Array, measured: jax.Array) -> jax.Array:
        """The wrench, selected equations, shape (N, r); `measured` has shape (N, 6) or (N, r)."""
        return _selected(measured, self._equations)


class LoadIntegralPart(WindowPart):
    """Integrals of the wrench over time windows per parameter."""  # columns (p,)

    def __init__(self, model: LoadIntegralModel, columns: Index) -> None:
        self.window = model.window
        self._frame, self._S = _SensorFrame(model.robot, model.sensor), np.eye(len(model.columns))[:, columns]
        self._equations = [EQUATIONS.index(name) for name in model.sensor.equations]

    def state(self, q: jax.Array, dq: jax.Array) -> jax.Array:
        """Momentum, shape (r, p, L)."""
        w, _, v, _, _ = self._frame.motion(q, dq, jnp.zeros_like(q))
        return reduced(momentum(*_directed(self._frame, w, v)), self._S)

    def density(self, q: jax.Array, dq: jax.Array) -> jax.Array:
        """Effort at the acceleration ``omega x v - g`` without angular acceleration, shape (r, p, L)."""
        w, _, v, _, up = self._frame.motion(q, dq, jnp.zeros_like(q))
        return reduced(effort(*_directed(self._frame, w, jnp.zeros_like(w), cross(w, v) - up)), self._S)

    def measured_density(self, dq: jax.Array, measured: jax.Array) -> jax.Array:
        """The wrench itself, selected equations, shape (N, r); `measured` has shape (N, 6) or (N, r)."""
        return _selected(measured, self._equations)


def _selected(measured: jax.Array, equations: list[int]) -> jax.Array:
    return measured[:, equations] if measured.shape[1] == len(EQUATIONS) else measured


def _directed(frame: _SensorFrame, *motion: jax.Array) -> tuple[jax.Array, ...]:
    """Directions of the equations and the same motion for each, shape (r, 3, L)."""
    shape = (len(frame.l), *motion[0].shape)
    return tuple(jnp.broadcast_to(jnp.asarray(x), shape) for x in (frame.l, frame.s, *motion))

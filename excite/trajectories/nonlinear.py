"""Trajectory families that are linear in some of their parameters only, such as sines of free frequencies.

x is flat: first the coefficients in which the motion is linear, ``size`` for each of k coordinates, then the shape s
that the functions they multiply depend on, ``y_j(t) = basis_j(s, t) c_j``.
"""

from __future__ import annotations

import copy
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Self

import numpy as np
import scipy

from excite.trajectories.family import Family, GridMotion, JointMotion, MotionTangent, Trajectory
from regressors.errors import InputError
from regressors.models.partial import PartialMotion
from regressors.samples import Array, Index

_ITERATIONS, _INSTANTS = 40, 200  # of a least-squares fit


class NonlinearFamily(Family):
    """Motions at rest at both ends whose basis depends on parameters, the shape.

    A carried family contains the motions ``q = matrix y + offset`` for such motions y.
    """

    linear = False
    _map: tuple[Array, Array] | None = None

    @abstractmethod
    def shape(self, count: int, rng: np.random.Generator | None = None) -> Array:
        """Shape of motions of some coordinates: the most regular one, or a random one."""

    @abstractmethod
    def coordinates(self, x: Array) -> int:
        """Number of coordinates that x moves."""

    @abstractmethod
    def bases(self, x: Array, time: Array, derivative: int) -> Array:
        """Functions that the coefficients multiply, shape (k, N, size); shared by all coordinates if k is 1."""

    @abstractmethod
    def shape_slopes(self, x: Array, time: Array, derivative: int) -> Array:
        """Derivative of the motion y with respect to the shape, shape (N, k, shape)."""

    @abstractmethod
    def nodes(self, x: Array, count: int) -> tuple[Array, Array | None]:
        """Instants of a grid, and their derivatives with respect to the shape, (N, shape), where they depend on it."""

    @abstractmethod
    def restored(self, series: Mapping[str, Any]) -> Array:
        """The x from the entries of `to_dict`."""

    def stored(self, series: Mapping[str, Any], joints: int) -> Trajectory:
        """The motion of ``joints`` joints, ``q = matrix y + rest`` with the family's y."""
        x = self.restored(series)
        matrix, rest = np.array(series["matrix"], dtype=float), np.array(series["rest"], dtype=float)
        expected = (joints, self.coordinates(x))
        shapes = matrix.shape == expected and rest.shape == expected[:1]
        if not shapes or not all(np.all(np.isfinite(a)) for a in (x, matrix, rest)):
            raise InputError(
                f"trajectory: expected finite numbers for {expected[1]} coordinates of {expected[0]} joints, "
                f"given a matrix of shape {matrix.shape}"
            )
        return Trajectory(self, x).carried(matrix, rest)

    def split(self, x: Array) -> tuple[Array, Array]:
        """Coefficients, shape (k, size), and shape: views of x."""
        linear = self.coordinates(x) * self.size
        return x[:linear].reshape(-1, self.size), x[linear:]

    def resting(self, pose: Array, rng: np.random.Generator | None = None) -> Array:
        """Rest, with the most regular shape or a random one."""
        return np.concatenate([np.outer(pose, self.constant).ravel(), self.shape(len(pose), rng)])

    def coordinate_motion(self, x: Array, time: Array, derivative: int) -> Array:
        """Motion y of the coordinates, shape (N, k)."""
        linear, _ = self.split(x)
        return np.asarray((self.bases(x, time, derivative) @ linear[:, :, None])[:, :, 0].T)

    def jacobian(self, x: Array, time: Array, derivative: int) -> Array:
        """Derivative of the motion y with respect to x, shape (N, k, x.size)."""
        k = self.coordinates(x)
        slopes = np.zeros((time.size, k, x.size))
        bases = np.broadcast_to(self.bases(x, time, derivative), (k, time.size, self.size))
        for j, basis in enumerate(bases):
            slopes[:, j, j * self.size : (j + 1) * self.size] = basis
        slopes[:, :, k * self.size :] = self.shape_slopes(x, time, derivative)
        return slopes

    def motion(self, x: Array, time: Array, derivative: int) -> Array:
        """Motion of the joints, or of the coordinates where the family is not carried, shape (N, n)."""
        y = self.coordinate_motion(x, np.asarray(time, dtype=float), derivative)
        if self._map is None:
            return y
        matrix, offset = self._map
        return np.asarray(y @ matrix.T + (offset if derivative == 0 else 0.0))

    def carried(self, x: Array, matrix: Array, offset: Array) -> tuple[Self, Array]:
        """A carried family, with the same x."""
        changed = copy.copy(self)
        first, held = self._carrying(x)
        changed._map = (matrix @ first, matrix @ held + offset)
        return changed, x

    def _carrying(self, x: Array) -> tuple[Array, Array]:
        k = self.coordinates(x)
        return self._map if self._map is not None else (np.eye(k), np.zeros(k))

    def joints(self, time: Array, motion: PartialMotion) -> JointMotion:
        """Motion of the joints, evaluated anew for every x."""

        def values(x: Array) -> list[Array]:
            orders = [motion.matrix @ self.coordinate_motion(x, time, d).T for d in range(3)]
            orders[0] = orders[0] + motion.offset[:, None]
            return [np.ascontiguousarray(values) for values in orders]

        def pullback(x: Array, slopes: Sequence[Array]) -> Array:
            gradient = np.zeros(x.size)
            for d, slope in enumerate(slopes):
                weights = (motion.matrix.T @ slope).T
                gradient += weights.ravel() @ self.jacobian(x, time, d).reshape(-1, x.size)
            return gradient

        return JointMotion(values, pullback)

    def on_grid(self, count: int) -> GridMotion:
        """Motion on `nodes`, which may depend on x, evaluated anew for every x."""

        def values(x: Array, derivative: int) -> Array:
            return self.coordinate_motion(x, self.nodes(x, count)[0], derivative)

        def tangent(x: Array, derivatives: Sequence[int], instants: Index) -> MotionTangent:
            jacobians = [self._node_jacobian(x, d, count, instants) for d in derivatives]  # each (T, k, x.size)

            def rows(weights: Array, place: Index) -> Array:
                parts = ((weights[:, order][:, None, :] @ J[place])[:, 0] for order, J in enumerate(jacobians))
                return sum(parts, np.zeros((place.size, x.size)))

            return rows

        return GridMotion(
            linear=False,
            factor=partial(self.grid_factor, count),
            values=values,
            combined=lambda x, matrix, derivative: np.asarray(matrix @ values(x, derivative).T),
            tangent=tangent,
        )

    def _node_jacobian(self, x: Array, derivative: int, count: int, instants: Index) -> Array:
        """Derivative with respect to x at some nodes, including their motion with x, shape (T, k, x.size)."""
        time, drift = self.nodes(x, count)
        jacobian = self.jacobian(x, time[instants], derivative)
        if drift is not None:
            rate = self.coordinate_motion(x, time[instants], derivative + 1)
            jacobian[:, :, x.size - drift.shape[1] :] += rate[:, :, None] * drift[instants][:, None, :]
        return jacobian

    def nearest(self, time: Array, q: Array) -> Array:
        """Nearest motion by nonlinear least squares, starting from the most regular shape."""
        few = slice(None, None, max(1, time.size // _INSTANTS))
        time, q = time[few], q[few]
        start = self.resting(np.zeros(q.shape[1]))
        linear, _ = self.split(start)
        bases = np.broadcast_to(self.bases(start, time, 0), (q.shape[1], time.size, self.size))
        for row, basis, wanted in zip(linear, bases, q.T, strict=True):
            row[:] = np.linalg.lstsq(basis, wanted, rcond=None)[0]

        def misfit(x: Array) -> Array:
            return np.asarray((self.coordinate_motion(x, time, 0) - q).ravel())

        def slopes(x: Array) -> Array:
            return self.jacobian(x, time, 0).reshape(-1, x.size)

        return np.asarray(scipy.optimize.least_squares(misfit, start, slopes, max_nfev=_ITERATIONS).x)

    def carrying(self, x: Array) -> dict[str, object]:
        """Map from the coordinates to the joints, for `to_dict`."""
        matrix, offset = self._carrying(x)
        return {"matrix": matrix.tolist(), "rest": offset.tolist()}

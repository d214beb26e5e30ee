"""Trajectory families that are linear in their coefficients: one basis, the same for every motion."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from functools import cache, partial
from typing import Any, ClassVar

import numpy as np

from constraints.certificate import Extrema
from excite.trajectories.family import Family, GridMotion, JointMotion, MotionTangent, Trajectory
from regressors.errors import InputError
from regressors.models.partial import PartialMotion
from regressors.samples import Array, Index


class LinearFamily(Family):
    """Motions ``q_j(t) = basis(t) x_j`` of any number of joints, at rest at both ends.

    The conditions at the ends are built into the basis, so every x of shape (n, size) is a motion of the family.

    Attributes
    ----------
    parts : tuple of str
        Entries of a file that hold the physical coefficients, concatenated in this order.
    form : str
        The motion as a formula of these entries, for whoever reads the file.
    """

    linear = True
    parts: ClassVar[tuple[str, ...]] = ("coefficients",)
    form: ClassVar[str] = ""
    _Z: Array  # maps free to physical coefficients, (physical, size)

    def coefficients(self, x: Array) -> Array:
        """Physical coefficients per joint, from free ones of shape (n, size)."""
        return np.asarray(x @ self._Z.T)

    def from_coefficients(self, coefficients: Array) -> Array:
        """Free coefficients from physical ones, projected onto motions at rest at both ends."""
        return np.asarray(coefficients @ np.linalg.pinv(self._Z).T)

    def to_dict(self, x: Array) -> dict[str, object]:
        """Family, period, options, and the physical coefficients of each joint."""
        options = {name: getattr(self, name) for name in self.options}
        form = {"form": self.form} if self.form else {}
        parts = zip(self.parts, self._split(self.coefficients(x)), strict=True)
        series = {name: part.tolist() for name, part in parts}
        return {"family": self.name, "period": self.duration, **options, **form, **series}

    def _split(self, coefficients: Array) -> list[Array]:
        """Physical coefficients by the `parts` of a file."""
        return [coefficients]

    @property
    def constant(self) -> Array:
        """Coefficients of the motion that rests at position 1; the first physical one is the mean."""
        return self.from_coefficients(np.eye(1, len(self._Z))[0])

    def stored(self, series: Mapping[str, Any], joints: int) -> Trajectory:
        """The motion of ``joints`` joints, from its physical coefficients."""
        coefficients = np.column_stack([np.array(series[part], dtype=float) for part in self.parts])
        expected = (joints, self.coefficients(self.constant[None]).shape[1])
        if coefficients.shape != expected or not np.all(np.isfinite(coefficients)):
            raise InputError(
                f"trajectory: expected {expected[1]} finite coefficients for each of {expected[0]} joints, "
                f"given an array of shape {coefficients.shape}"
            )
        return Trajectory(self, self.from_coefficients(coefficients))

    @abstractmethod
    def basis(self, time: Array, derivative: int) -> Array:
        """Basis functions or their derivatives at given instants.

        Parameters
        ----------
        time : ndarray, shape (N,)
            [s]
        derivative : int
            0 for position to 3 for jerk.

        Returns
        -------
        ndarray, shape (N, size)
        """

    @abstractmethod
    def extrema(self, x: Array, derivative: int) -> Extrema:
        """Exact extrema over continuous time.

        Parameters
        ----------
        x : ndarray, shape (k, size)
            Coefficients of k functions.
        derivative : int
        """

    def split(self, x: Array) -> tuple[Array, Array]:
        """All of x, and no shape."""
        return x, x[:0].ravel()

    def motion(self, x: Array, time: Array, derivative: int) -> Array:
        """``basis x'``, shape (N, n)."""
        return np.asarray(self.basis(time, derivative) @ x.T)

    def carried(self, x: Array, matrix: Array, offset: Array) -> tuple[LinearFamily, Array]:
        """The same family, with other coefficients."""
        return self, np.asarray(matrix @ x + np.outer(offset, self.constant))

    def joints(self, time: Array, motion: PartialMotion) -> JointMotion:
        """Motion of the joints by the basis, which is evaluated once."""
        bases = [self.basis(time, d) for d in range(3)]
        N, held = motion.matrix, np.outer(motion.offset, self.constant)

        def values(x: Array) -> list[Array]:
            joints = N @ x + held
            return [np.ascontiguousarray(joints @ B.T) for B in bases]

        def pullback(x: Array, slopes: Sequence[Array]) -> Array:
            return np.asarray(N.T @ sum(s @ B for s, B in zip(slopes, bases, strict=True)))

        return JointMotion(values, pullback)

    def on_grid(self, count: int) -> GridMotion:
        """Motion on equal steps by the basis, which is evaluated once."""
        basis = cache(lambda derivative: self.basis(self.grid(count), derivative))  # each (N, size)

        def tangent(x: Array, derivatives: Sequence[int], instants: Index) -> MotionTangent:
            bases = [basis(d) for d in derivatives]

            def rows(weights: Array, place: Index) -> Array:
                at = instants[place]
                first, *others = (weights[:, o, :, None] * B[at][:, None, :] for o, B in enumerate(bases))
                for term in others:
                    first += term
                return np.asarray(first.reshape(place.size, first.shape[1] * first.shape[2]))

            return rows  # the basis itself; no Jacobian is stored

        return GridMotion(
            linear=True,
            factor=partial(self.grid_factor, count),
            values=lambda x, derivative: np.asarray(basis(derivative) @ x.T),
            combined=lambda x, matrix, derivative: np.asarray((matrix @ x) @ basis(derivative).T),
            tangent=tangent,
        )

    def resting(self, pose: Array, rng: np.random.Generator | None = None) -> Array:
        """Rest as multiples of `constant`."""
        return np.outer(pose, self.constant)

    def nearest(self, time: Array, q: Array) -> Array:
        """Nearest motion by linear least squares."""
        return np.asarray(np.linalg.lstsq(self.basis(time, 0), q, rcond=None)[0].T)

    def combined_extrema(self, x: Array, matrix: Array, offset: Array, derivative: int) -> Extrema:
        """Extrema of the functions with the combined coefficients."""
        return self.extrema(matrix @ x + np.outer(offset, self.constant), derivative)

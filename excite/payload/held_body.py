"""A body that a robot holds: mass, centre and inertia, with their uncertainty; what is possible, and rated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import ArrayLike

from excite.identification.estimators.possible_set import PossibleSet, body_in_coordinates, nearest, own_scale
from regressors.errors import InputError
from regressors.quantities import check
from regressors.robot.inertia import (
    from_centre_of_mass,
    from_pseudo_inertia,
    inertia_tensor,
    pseudo_inertia,
    skew,
    transport,
)
from regressors.samples import Array

_STEP = 1e-6
UPPER = np.triu_indices(3)


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame fixed to the last link, such as the flange, in which a body is stated."""

    name: str  # what it is, for people
    rotation: Array  # (3, 3) its axes in the frame of the last link
    translation: Array  # (3,) its origin in the frame of the last link [m]

    @property
    def from_link(self) -> Array:
        """Map of a body's ten parameters from the last link's frame to this one, shape (10, 10)."""
        return transport(self.rotation.T, -self.rotation.T @ self.translation)

    @property
    def to_link(self) -> Array:
        """Map of a body's ten parameters from this frame to the last link's, shape (10, 10)."""
        return transport(self.rotation, self.translation)


def frame_numbers(given: Sequence[float] | None) -> Array:
    """Origin x, y, z [m] and roll, pitch, yaw [rad] of a frame that is given, shape (6,); zeros where none is."""
    x = np.zeros(6) if given is None else np.asarray(given, dtype=float)
    if x.shape not in ((3,), (6,)) or not np.all(np.isfinite(x)):
        raise InputError("`frame` needs x, y, z [m], or these and roll, pitch, yaw [rad]")
    check("sensor_xyz", x[:3], "`frame`")
    check("sensor_rpy", x[3:], "`frame`")
    return np.concatenate([x, np.zeros(6 - x.size)])


@dataclass(frozen=True, eq=False)
class HeldBody:
    """Mass, centre of mass and inertia about it, in the axes of a frame."""

    mass: float  # [kg]
    centre: Array  # (3,) [m]
    inertia: Array  # (3, 3) about the centre of mass [kg m^2]

    @classmethod
    def of(cls, phi: ArrayLike) -> HeldBody:
        """The body with ten parameters about the frame's origin, ``I_C = I_O + m skew(c) skew(c)``."""  # phi (10,)
        phi = np.asarray(phi, dtype=float)
        centre = phi[1:4] / phi[0]
        return cls(float(phi[0]), centre, inertia_tensor(phi) + phi[0] * skew(centre) @ skew(centre))

    @property
    def parameters(self) -> Array:
        """The ten parameters about the frame's origin, shape (10,)."""
        return from_centre_of_mass(self.mass, self.centre, self.inertia)

    @property
    def listed(self) -> Array:
        """Mass, centre, and xx, xy, xz, yy, yz, zz of the inertia, shape (10,)."""
        return np.concatenate([[self.mass], self.centre, self.inertia[UPPER]])

    @property
    def principal(self) -> tuple[Array, Array]:
        """Principal moments [kg m^2], and the axes as columns of a rotation, those nearest to the axes of the frame."""
        moments, axes = np.linalg.eigh(self.inertia)
        orders = [list(order) for order in permutations(range(3))]
        order = max(orders, key=lambda order: np.prod(np.abs(np.diag(axes[:, order]))))
        axes = axes[:, order] * np.sign(np.diag(axes[:, order]) + 1e-300)
        if np.linalg.det(axes) < 0:
            weakest = int(np.argmin(np.abs(np.diag(axes))))
            axes[:, weakest] *= -1.0
        return moments[order], axes


def spread_of(function: Callable[[Array], Array], at: Array, covariance: Array) -> Array:
    """Standard deviations of a function of uncertain numbers, to first order."""
    # function (k,); at (k,); covariance (k, k)
    size = np.sqrt(np.diag(covariance))
    columns = [(function(at + change) - function(at - change)) / (2 * _STEP) for change in np.diag(_STEP * size)]
    G, scale = np.column_stack(columns), np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
    correlation = covariance * scale[:, None] * scale
    return np.asarray(np.sqrt(np.maximum(np.einsum("ik,kl,il->i", G, correlation, G), 0.0)))


_LEAST = 1e-7  # of the size of the body: smallest eigenvalue of its pseudo-inertia in units of mass and length
_LEAST_LENGTH = 1e-3
_LEAST_VARIANCE = 1e-12  # of the largest one


def is_possible(phi: Array) -> bool:
    """Whether a body has the ten parameters: its pseudo-inertia is positive definite."""
    return bool(phi[0] > 0 and np.linalg.eigvalsh(pseudo_inertia(phi))[0] > 0)


def nearest_possible(phi: Array, covariance: Array) -> Array:
    """Parameters of a real body that the estimate excludes least.

    ``min (x - phi)' C^-1 (x - phi)`` subject to a positive definite pseudo-inertia of x; phi itself where it is one.
    """  # phi (10,); covariance (10, 10)
    if is_possible(phi):
        return phi
    length = max(_LEAST_LENGTH, np.linalg.norm(phi[1:4]) / phi[0], np.sqrt(np.abs(phi[4:]).max() / phi[0]))
    scale = phi[0] * length ** np.array([0, 1, 1, 1, 2, 2, 2, 2, 2, 2])
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    slope = scale[:, None] * vectors * np.sqrt(np.maximum(values, _LEAST_VARIANCE * values[-1]) / values[-1])
    ball = phi[0] * np.diag([length**2] * 3 + [1.0])
    M, B = body_in_coordinates(phi, slope, _LEAST * ball, own_scale(ball))
    inside = np.linalg.solve(slope, from_pseudo_inertia(ball) - phi)
    possible = PossibleSet(M[None], B[None], np.zeros(0), np.zeros((0, 10)))
    z, _ = nearest(possible, inside)
    return np.asarray(phi + slope @ possible.towards(z, inside))


RATED = {
    "irp6": 6.0,  # [KD96]
    "irp6-full": 6.0,
    "iiwa7": 7.0,  # KUKA, "LBR iiwa 7 R800" data sheet
    "panda": 3.0,  # Franka Emika, "Panda" data sheet
    "ur10e": 12.5,  # Universal Robots, "UR10e" data sheet
}
"""Largest payload, by the name of the robot [kg]."""

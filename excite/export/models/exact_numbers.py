"""Numbers as text that reads back to the same bits, and rotations as the angles and quaternions of file formats."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from regressors.robot.inertia import inertia_tensor, skew
from regressors.samples import Array


def number(value: float) -> str:
    """Shortest text that reads back to the same number; zero without a sign."""
    return repr(float(value) + 0.0).removesuffix(".0")


def numbers(values: ArrayLike) -> str:
    """Several numbers, separated by spaces."""
    return " ".join(number(value) for value in np.ravel(np.asarray(values, dtype=float)))


def rpy_of(R: Array) -> tuple[float, float, float]:
    """Roll, pitch, yaw with ``R = Rz(yaw) Ry(pitch) Rx(roll)``, to rounding accuracy also where pitch is 90 degrees."""
    # R (3, 3)
    yaw = math.atan2(R[1, 0], R[0, 0])
    c, s = math.cos(yaw), math.sin(yaw)
    pitch = math.atan2(-R[2, 0], c * R[0, 0] + s * R[1, 0])
    roll = math.atan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    return roll, pitch, yaw


def quaternion_of(R: Array) -> Array:
    """Unit quaternion of a rotation, its real part first, shape (4,)."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(R).as_quat()
    return np.array([w, x, y, z])


def about_centre(theta: Array) -> tuple[float, Array, Array]:
    """Mass [kg], centre of mass [m], shape (3,), and inertia about it [kg m^2], shape (3, 3), in the axes of the frame.

    ``I_C = I_O + m skew(c)^2``; a body without mass has its centre in the origin.
    """  # theta (10,)
    mass = float(theta[0])
    c = np.asarray(theta[1:4]) / mass if mass else np.zeros(3)
    return mass, c, np.asarray(inertia_tensor(theta) + mass * skew(c) @ skew(c))


def upper(I: Array) -> dict[str, float]:
    """Six elements of a symmetric tensor by the names that URDF gives them."""
    places = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    return {name: float(I[place]) for name, place in places.items()}

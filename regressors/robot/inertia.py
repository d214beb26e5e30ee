"""Inertial parameters of a rigid body: order, pseudo-inertia, change of frame.

The ten parameters of a body are expressed about the origin of its link frame, in the axes of that frame:
``theta = (m, mcx, mcy, mcz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz)``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

PARAMETERS_PER_LINK = 10
_TENSOR = np.array([[4, 5, 6], [5, 7, 8], [6, 8, 9]])  # places of a tensor's entries in theta


def parameter_names(link: int) -> tuple[str, ...]:
    """Names of one link's ten parameters, such as ``m3``, ``m3c3x``, ``I3yy``."""
    inertia = (f"I{link}{axes}" for axes in ("xx", "xy", "xz", "yy", "yz", "zz"))
    return (f"m{link}", *(f"m{link}c{link}{axis}" for axis in "xyz"), *inertia)


PARAMETER_UNITS = ("kg", *("kg m",) * 3, *("kg m^2",) * 6)


def skew(v: ArrayLike) -> Array:
    """Matrix of the cross product, ``skew(v) @ w = v x w``."""
    x, y, z = np.asarray(v, dtype=float)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def is_rotation(R: Array) -> bool:
    """Whether a matrix turns vectors, without a reflection."""
    small = R.shape == (3, 3) and bool(np.all(np.abs(R) < 2.0))
    return small and np.allclose(R @ R.T, np.eye(3), atol=1e-9) and not np.linalg.det(R) < 0


def rotation_from_rpy(rpy: ArrayLike) -> Array:
    """Rotation about the fixed x, y, z axes in turn, ``Rz(yaw) Ry(pitch) Rx(roll)``, as in a URDF."""  # rpy (3,)
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    rx = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    ry = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    rz = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return np.asarray(rz @ ry @ rx)


def from_centre_of_mass(mass: float, centre: ArrayLike, inertia: ArrayLike) -> Array:
    """Parameters about the frame's origin from those about the centre of mass, ``I_O = I_C - m skew(c) skew(c)``."""
    # centre (3,); inertia (3, 3)
    c = np.asarray(centre, dtype=float)
    tensor = np.asarray(inertia, dtype=float) - mass * skew(c) @ skew(c)
    return np.concatenate([[mass], mass * c, tensor[np.triu_indices(3)]])


def inertia_tensor(theta: ArrayLike) -> Array:
    """Inertia tensor about the frame's origin [kg m^2], shape (3, 3), of one body's ten parameters."""
    return np.asarray(np.asarray(theta, dtype=float)[_TENSOR])


def pseudo_inertia(theta: ArrayLike) -> Array:
    """Pseudo-inertia ``J = int [x; 1] [x; 1]' dm = [[tr(I)/2 E - I, m c], [m c', m]]``, > 0 for every real body."""
    # theta (10,)
    t = np.asarray(theta, dtype=float)
    tensor = inertia_tensor(t)
    J = np.empty((4, 4))
    J[:3, :3] = 0.5 * np.trace(tensor) * np.eye(3) - tensor
    J[:3, 3] = J[3, :3] = t[1:4]
    J[3, 3] = t[0]
    return J


def from_pseudo_inertia(J: ArrayLike) -> Array:
    """Inverse of `pseudo_inertia`: ``I = tr(S) E - S`` with ``S = J[:3, :3]``."""  # J (4, 4)
    J = np.asarray(J, dtype=float)
    S = J[:3, :3]
    tensor = np.trace(S) * np.eye(3) - S
    return np.concatenate([[J[3, 3]], J[:3, 3], tensor[np.triu_indices(3)]])


def pose_of(rotation: ArrayLike, translation: ArrayLike) -> Array:
    """Pose of a frame from its axes and its origin, shape (4, 4)."""  # rotation (3, 3); translation (3,)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation, translation
    return T


def transport(rotation: ArrayLike, translation: ArrayLike) -> Array:
    """Matrix (10, 10) that takes theta to a frame in which the body's frame has the pose T, ``J_new = T J T'``."""
    # rotation (3, 3); translation (3,)
    T = pose_of(rotation, translation)
    unit = np.eye(PARAMETERS_PER_LINK)
    return np.column_stack([from_pseudo_inertia(T @ pseudo_inertia(e) @ T.T) for e in unit])

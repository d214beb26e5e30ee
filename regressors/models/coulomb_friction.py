"""Friction columns with the direction of motion: their drives, magnitudes, and the equations they act on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from regressors.models.columns import DIRECTED_KINDS
from regressors.models.drives import drive_rows
from regressors.models.reduction import Reduction
from regressors.robot.robot import Robot
from regressors.samples import Array, Index, Samples

Magnitudes = Callable[[Samples], Array]


@dataclass(frozen=True, eq=False)
class CoulombFriction:
    """Directed friction of a model of torques: each column is the sum of ``magnitude_k direction_k rows_k`` over its k.

    Coulomb friction has the magnitude 1; load shares, roots and Stribeck friction have others, see
    `regressors.models.columns.Terms`.

    Parameters
    ----------
    columns : ndarray of int, shape (k,)
        Columns of the model, in ascending order; one that several drives share is repeated for each of them.
    coupling : ndarray, shape (k, n)
        Row of C of each column's drive, whose velocity is ``coupling @ dq`` [rad/s or m/s].
    rows : ndarray, shape (k, r)
        Contribution of a unit torque of the drive to each equation.
    magnitudes : callable
        From N samples to the friction per unit parameter, shape (N, k) [Nm or N per unit].
    """

    columns: Index
    coupling: Array
    rows: Array
    magnitudes: Magnitudes


def coulomb_friction(
    robot: Robot, composition: Reduction, directions: Array, magnitudes: Magnitudes
) -> CoulombFriction:
    """Columns of directed friction of equations along some directions, ``N' C' tau_z``."""
    # directions (n, r); magnitudes (N, standard columns)
    drives = drive_rows(robot)
    directed = [
        (k, drives[column.owner])
        for k, column in enumerate(composition.standard)
        if column.kind in DIRECTED_KINDS and column.owner is not None
    ]
    shares = composition.matrix[[k for k, _ in directed]].T  # of each drive in each column
    columns, drive = np.nonzero(shares)
    C = np.array([row for _, row in directed]).reshape(-1, robot.n)[drive]
    rows = shares[columns, drive][:, None] * (C @ directions)
    return CoulombFriction(columns, C, rows, lambda samples: magnitudes(samples)[:, drive])

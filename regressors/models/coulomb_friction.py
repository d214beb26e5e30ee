"""Coulomb columns of a model: the drives whose velocities give their signs, and the equations they act on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from regressors.models.columns import COULOMB
from regressors.models.drives import drive_rows
from regressors.models.reduction import Reduction
from regressors.robot.robot import Robot
from regressors.samples import Array, Index


@dataclass(frozen=True, eq=False)
class CoulombFriction:
    """Coulomb columns of a model of torques: each is the sum of ``direction_k rows_k`` over its own k.

    Parameters
    ----------
    columns : ndarray of int, shape (k,)
        Columns of the model, in ascending order; one that several drives share is repeated for each of them.
    coupling : ndarray, shape (k, n)
        Row of C of each column's drive, whose velocity is ``coupling @ dq`` [rad/s or m/s].
    rows : ndarray, shape (k, r)
        Contribution of a unit torque of the drive to each equation.
    """

    columns: Index
    coupling: Array
    rows: Array


def coulomb_friction(robot: Robot, composition: Reduction, directions: Array) -> CoulombFriction:
    """Coulomb columns of equations along some directions, ``N' C' tau_z``.

    Parameters
    ----------
    robot : Robot
    composition : Reduction
        Composition of the columns from standard ones.
    directions : ndarray, shape (n, r)
        ``N``.
    """
    drives = drive_rows(robot)
    coulomb = [
        (k, drives[column.owner])
        for k, column in enumerate(composition.standard)
        if column.kind == COULOMB and column.owner is not None
    ]
    shares = composition.matrix[[k for k, _ in coulomb]].T  # of each drive in each column
    columns, drive = np.nonzero(shares)
    C = np.array([row for _, row in coulomb]).reshape(-1, robot.n)[drive]
    return CoulombFriction(columns, C, shares[columns, drive][:, None] * (C @ directions))

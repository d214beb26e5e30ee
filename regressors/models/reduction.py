"""Structural knowledge applied to a regressor: parameters known to be zero, shared, or used only in combinations.

With ``theta = S p`` the columns in p are ``Y S``. A robot may name the combinations ``X = B p`` that its model is
written in; then ``Y S = Y_X B`` and the columns in X are ``Y S R`` with any R that has ``B R = E``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
import scipy

from regressors.errors import UnknownName, check_names
from regressors.models.drives import column_list, drive_motions, drive_rows, reflections
from regressors.numerical import independent_columns
from regressors.robot.columns import (
    COMBINATION,
    DIRECTED_KINDS,
    FRICTION_KINDS,
    ROTOR,
    Column,
    Terms,
    body_columns,
    drive_column,
)
from regressors.robot.inertia import parameter_names
from regressors.robot.robot import Aggregates, Robot, Structure, drive_numbers
from regressors.robot.symbolic.kinematics import sparse
from regressors.samples import Array, Index, Samples


def inertial_columns(robot: Robot) -> tuple[Column, ...]:
    """Standard inertial parameters of every body: links, then branches."""
    return tuple(column for number in robot.body_numbers for column in body_columns(parameter_names(number), number))


def standard_columns(robot: Robot) -> tuple[Column, ...]:
    """Every standard parameter that a robot can have, with all terms and all drives, moving or locked."""
    kinds = (ROTOR, *FRICTION_KINDS)
    drives = (drive_column(number, kind) for number in drive_rows(robot) for kind in kinds)
    return (*inertial_columns(robot), *drives)


@dataclass(frozen=True, eq=False)
class Reduction:
    """Map from the standard parameters' columns to those that remain under the robot's structure."""

    standard: tuple[Column, ...]  # before the structure is used
    columns: tuple[Column, ...]  # what remains
    matrix: Array  # (standard, columns) ``Y_left = Y_standard @ matrix``
    definition: Array  # (columns, standard) value of each remaining parameter, ``definition @ standard``

    @classmethod
    def none(cls, columns: tuple[Column, ...]) -> Reduction:
        """Identity reduction, for columns that are standard ones themselves."""
        return cls(columns, columns, np.eye(len(columns)), np.eye(len(columns)))

    def extended(self, columns: tuple[Column, ...]) -> Reduction:
        """The same with further standard columns appended, which are not reduced."""
        if not columns:
            return self
        further = np.eye(len(columns))
        return Reduction(
            (*self.standard, *columns),
            (*self.columns, *columns),
            np.asarray(scipy.linalg.block_diag(self.matrix, further)),
            np.asarray(scipy.linalg.block_diag(self.definition, further)),
        )

    def apply(self, Y: ca.SX) -> ca.SX:
        """Columns of the remaining parameters, as an expression."""
        if np.array_equal(self.matrix, np.eye(len(self.standard))):
            return Y
        return ca.sparsify(ca.mtimes(Y, sparse(self.matrix)))


def free_parameters(structure: Structure, names: Sequence[str]) -> tuple[list[str], Array, Array]:
    """Names of those that are free, S of ``theta = S phi``, and its inverse, in which mirrored limbs have no part."""
    leader = {name: group[0] for group in structure.equal for name in group[1:]}
    tied = {name: terms for name, terms in structure.mirrored.items() if terms.keys() <= set(names)}
    free = [name for name in names if not (name in structure.zero or name in leader or name in tied)]
    leaders = np.array([leader.get(name, name) for name in names], dtype=str)
    own = (leaders[:, None] == np.array(free, dtype=str)).astype(float)
    S, place = own.copy(), {name: k for k, name in enumerate(names)}
    for name, row in place.items():
        terms = {} if name in structure.zero else tied.get(leader.get(name, name), {})
        for one, coefficient in terms.items():
            S[row] += coefficient * own[place[one]]
    return free, S, (own / own.sum(axis=0)).T


def _zero_and_equal(robot: Robot, standard: tuple[Column, ...]) -> tuple[tuple[Column, ...], Array, Array]:
    names = [column.name for column in standard]
    structure = robot.structure
    possible = {column.name for column in standard_columns(robot)}  # a model may leave out some columns of drives
    for name in (*structure.zero, *(name for group in structure.equal for name in group)):
        if name not in names and name not in possible:
            raise UnknownName("parameter", name, names)
    free, S, value = free_parameters(structure, names)
    return tuple(column for column in standard if column.name in set(free)), S, value


def _reflected(robot: Robot, columns: tuple[Column, ...]) -> tuple[tuple[Column, ...], Array]:
    """Columns with rotor inertias at the drive coordinates, and how many times the motors' own these are."""
    by_drive = reflections(robot)
    seen = [by_drive.get(c.owner) if c.kind == ROTOR and c.owner is not None else None for c in columns]
    pairs = list(zip(columns, seen, strict=True))
    names = tuple(column if at is None else at.column(column) for column, at in pairs)
    return names, np.array([1.0 if at is None else at.ratio**2 for at in seen])


def _aggregated(form: Aggregates, columns: tuple[Column, ...]) -> tuple[tuple[Column, ...], Array, Array]:
    """Columns of the aggregates, then those of the friction parameters, which stay as they are."""
    friction = [c for c in columns if c.group not in ("inertial", "rotor")]
    combinations = [*form.parameters.values(), *({column.name: 1.0} for column in friction)]
    B = np.array([[terms.get(column.name, 0.0) for column in columns] for terms in combinations], dtype=float)
    aggregates = []
    for name, terms in form.parameters.items():
        units = {c.unit for c in columns if c.name in terms and terms[c.name] in (1.0, -1.0)}
        aggregates.append(Column(name, units.pop() if len(units) == 1 else "", COMBINATION))
    chosen = independent_columns(B)
    R = np.zeros(B.T.shape)
    R[chosen] = np.linalg.inv(B[:, chosen])
    return (*aggregates, *friction), R + 0.0, B


Magnitudes = Callable[[Samples], Array]


def reduction_by(robot: Robot, terms: Terms) -> Reduction:
    """Columns of a robot's bodies, and those that terms choose of its drives, reduced by its structure."""
    check_names("drive", map(str, terms.numbers), [str(number) for number in drive_numbers(robot)])
    drives = drive_motions(robot, *(ca.SX.sym(name, robot.n) for name in ("q", "dq", "ddq")))
    standard = (*inertial_columns(robot), *column_list(drives, terms))
    columns, S, value = _zero_and_equal(robot, standard)
    form = next((a for a in robot.structure.aggregates if a.joints == robot.joint_names), None)
    if form is None:
        columns, factors = _reflected(robot, columns) if terms.reflected else (columns, np.ones(len(columns)))
        return Reduction(standard, columns, S / factors, value * factors[:, None])
    columns, R, B = _aggregated(form, columns)  # combinations that the structure names stay as named
    return Reduction(standard, columns, S @ R, B @ value)


@dataclass(frozen=True, eq=False)
class CoulombFriction:
    """Directed friction of a model of torques: each column is the sum of ``magnitude_k direction_k rows_k`` over its k.

    Coulomb friction has the magnitude 1; load shares, roots and Stribeck friction have others, see
    `regressors.robot.columns.Terms`.
    """

    columns: Index  # (k,) of the model, in ascending order; one that several drives share is repeated for each of them
    coupling: Array  # (k, n) row of C of each column's drive, whose velocity is ``coupling @ dq`` [rad/s or m/s]
    rows: Array  # (k, r) contribution of a unit torque of the drive to each equation
    magnitudes: Magnitudes  # from N samples to the friction per unit parameter, shape (N, k) [Nm or N per unit]


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

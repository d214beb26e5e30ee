"""Torque limits that hold for every robot whose parameters are near the described ones: a robust counterpart.

The torque is linear in the standard parameters u, ``tau = Y(q, dq, ddq) u``, so that its largest value over the box
``|u_i - u^_i| <= d_i`` is exactly ``Y u^ + sum_i |Y_i| d_i`` [Ben-Tal, El Ghaoui, Nemirovski 2009, section 1.3], and
the least one likewise. Both are functions of the motion as any other, and are enclosed over continuous time.

[Ben-Tal, El Ghaoui, Nemirovski 2009] "Robust Optimization", Princeton University Press.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from constraints.friction.drive_friction import drive_friction
from constraints.limit import Limit
from constraints.limits.torque import LimitedTorques, check_inertias, joint_torque, limited_torques
from constraints.nonlinear import Expression, NonlinearConstraint
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.models.columns import COULOMB, VISCOUS, Terms
from regressors.models.differential import DifferentialModel
from regressors.models.drives import drive_column
from regressors.models.nominal import standard_values, stated_deviations
from regressors.models.partial import PartialMotion
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.robot import Robot
from regressors.robot.symbolic.kinematics import sparse


@checked
@dataclass(frozen=True)
class PlausibleTorqueLimit(Limit):
    """The torque limits of joints and drives, kept by every robot of a box of parameters around the description.

    Each mass, first moment, entry of an inertia tensor, rotor inertia and friction coefficient is off by up to a share
    of its size, see `regressors.models.nominal.stated_deviations`, independently of the others: a first
    moment by a share of its length, an entry of an inertia tensor by a share of the largest principal moment. The box
    contains robots that no body could have, so the limit is never too loose for those that may exist. Parameters that
    the description does not state count as zero, as in `constraints.limits.torque`; friction curves count as known.

    Parameters
    ----------
    uncertainty : float
        Share, greater than 0.
    friction : FrictionCurves, optional
        Curves of some of the drives, which replace the friction in the robot's description.
    """

    uncertainty: float
    friction: FrictionCurves | None = None

    def imposed(self, robot: Robot, motion: PartialMotion) -> Sequence[NonlinearConstraint]:
        """One constraint for the joints and one for the drives, where these have torque limits.

        Raises
        ------
        InputError
            An uncertainty that is not greater than zero, a robot without torque limits, friction that uses up a limit,
            or see `constraints.limits.torque.torque_limits`.
        """
        if not 0 < self.uncertainty < np.inf:
            raise InputError(f"torque uncertainty must be a number greater than 0, given {self.uncertainty}")
        check_inertias(robot, "torque limits")
        known, coulomb = standard_values(robot), _coulomb_names(robot)
        largest = {name: value * (1 + self.uncertainty * (name in coulomb)) for name, value in known.items()}
        drives = drive_friction(robot, largest, motion, self.friction)
        torque = joint_torque(robot, {**known, **drives.viscous})
        carried = joint_torque(robot, {**known, **dict.fromkeys(drives.viscous, 0.0)})
        deviations = stated_deviations(robot, self.uncertainty)
        terms = _deviation_terms(robot, {**deviations, **dict.fromkeys(_of_curves(robot, self.friction), 0.0)})
        return [
            _limits(rows, robot.n, torque, carried, terms).restricted(motion) for rows in limited_torques(robot, drives)
        ]


def _coulomb_names(robot: Robot) -> set[str]:
    model = DifferentialModel(robot, Terms(rotor=False, viscous=False))
    return {column.name for column in model.standard_columns if column.kind == COULOMB}


def _of_curves(robot: Robot, friction: FrictionCurves | None) -> list[str]:
    """Names of the viscous friction of drives that have a curve."""
    if friction is None:
        return []
    transmission = robot.transmission
    names = robot.joint_names if transmission is None else [drive.name for drive in transmission.drives]
    numbers = robot.link_numbers if transmission is None else range(1, len(names) + 1)
    with_curve = (number for number, name in zip(numbers, names, strict=True) if friction.curve(name) is not None)
    return [drive_column(number, VISCOUS).name for number in with_curve]


def _deviation_terms(robot: Robot, deviations: Mapping[str, float]) -> Expression:
    """``Y diag(d)``, shape (n, parameters that deviate)."""
    model = DifferentialModel(robot, Terms(rotor=True, coulomb=False, viscous=True, offset=False))
    definition, names = model.definition()
    d = np.array([deviations.get(name, 0.0) for name in names])
    scaled = sparse(definition[:, d > 0] * d[d > 0])
    return lambda q, dq, ddq: ca.mtimes(model.rows(q, dq, ddq), scaled)


def _limits(
    rows: LimitedTorques, joints: int, torque: Expression, carried: Expression, terms: Expression
) -> NonlinearConstraint:
    """Largest torques below their limits, and least ones above; each with friction at its largest."""
    kept, (lower, upper) = rows.kept, rows.allowed(0.0)
    share = rows.friction.share[kept]
    matrix, loaded = sparse(rows.matrix[kept]), sparse(share[:, None] * rows.matrix[kept])

    def expression(q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        nominal = ca.mtimes(matrix, torque(q, dq, ddq))
        if loaded.nnz():
            nominal += ca.mtimes(loaded, carried(q, dq, ddq))
        deviation = ca.DM(1 + share) * ca.sum2(ca.fabs(ca.mtimes(matrix, terms(q, dq, ddq))))
        return ca.vertcat(nominal + deviation, nominal - deviation)

    none = np.full(kept.size, np.inf)
    ends = ("largest", "least")
    labels = tuple(f"{rows.labels[k]} of plausible robots, {end}" for end in ends for k in kept)
    return NonlinearConstraint(
        joints,
        expression,
        np.concatenate([-none, lower]),
        np.concatenate([upper, none]),
        np.tile(0.5 * (upper - lower), 2),
        labels,
        2 * tuple(rows.units[k] for k in kept),
        quantity="torque of plausible robots",
    )

"""The energy-integral model: work equals change of energy plus friction losses [KD96] eq. (4)-(7), (19).

``int tau' dq dt = [h]_{t_1}^{t_2} theta + int tau_f' dq dt`` over short or long windows.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from regressors.arguments import checked
from regressors.errors import InputError
from regressors.models.differential import DifferentialModel
from regressors.models.drives import (
    drive_motions,
    drive_rows,
    friction_terms,
    friction_torque,
)
from regressors.models.model import RegressorModel
from regressors.models.reduction import Reduction, reduction_by
from regressors.models.windows import Mask, Window, WindowModel
from regressors.robot.columns import COULOMB, OFFSET, Terms
from regressors.robot.robot import Robot
from regressors.robot.symbolic.kinematics import LinkMotion, bodies
from regressors.samples import Array, Index, Samples


def body_energy(body: LinkMotion, gravity: ca.SX) -> ca.SX:
    """Kinetic and potential energy of one body per parameter, shape (1, 10) [J per unit parameter].

    ``1/2 m v'v + mc'(v x omega) + 1/2 omega' I omega - m g'p - mc' R'g`` [KD96] eq. (4), (5).
    """  # gravity (3, 1)
    v, w = body.v, body.omega
    mass = ca.dot(v, v) / 2 - ca.dot(gravity, body.origin)
    moment = ca.cross(v, w) - body.up
    x, y, z = w[0], w[1], w[2]
    inertia = ca.horzcat(x * x / 2, x * y, x * z, y * y / 2, y * z, z * z / 2)
    return ca.horzcat(mass, moment.T, inertia)


@checked
class EnergyModel(WindowModel):
    """Work of the joint torques, linear in inertial, rotor and friction parameters [KD96] eq. (7), (14), (19).

    Parameters
    ----------
    robot : Robot
    terms : Terms, optional
        Optional columns beside the links' parameters.
    window : Window
    sign_width : float
        Velocity over which the sign of Coulomb friction changes [rad/s]; zero for the exact sign.

    Raises
    ------
    InputError
        Load shares, whose losses depend on the acceleration, which this model does without.
    UnknownName
        Terms of a drive that the robot does not have.
    """

    row_labels = (("work", "J"),)
    equations_can_be_chosen = False
    jax_form = "regressors.jax_models.jax_model:EnergyPart"
    reduction: Reduction

    def __init__(
        self, robot: Robot, terms: Terms | None = None, window: Window | None = None, *, sign_width: float = 0.0
    ) -> None:
        self.robot = robot
        self.terms = terms if terms is not None else Terms()
        self.window = window if window is not None else Window()
        self.sign_width = sign_width
        if self.terms.load_share:
            raise InputError(
                "friction that grows with the load depends on the acceleration, which the energy model does without; "
                "set `load_share` to false, or take the differential model"
            )
        self.reduction = reduction_by(robot, self.terms)
        self.columns = self.reduction.columns

    @property
    def options(self) -> dict[str, Any]:
        """Terms, windows and sign width."""
        return {"terms": self.terms, "window": self.window, "sign_width": self.sign_width}

    def instantaneous(self) -> RegressorModel:
        """Model of the torques whose work this model integrates.

        Raises
        ------
        InputError
            A subclass with further columns, whose torques are not known here.
        """
        model = DifferentialModel(self.robot, self.terms, sign_width=self.sign_width)
        return model if model.columns == self.columns else super().instantaneous()

    def state(self, q: ca.SX, dq: ca.SX) -> ca.SX:
        """Energy per parameter, h(q, dq): links, then rotors ``1/2 (F'(z) dz)^2``; friction stores none."""
        robot, still = self.robot, ca.SX(self.robot.n, 1)
        gravity = ca.SX(ca.DM(robot.gravity))
        links = ca.horzcat(*(body_energy(body, gravity) for body in bodies(robot, q, dq, still)))
        drives = drive_motions(robot, q, dq, still)
        rotors = [(d.ratio * d.dz) ** 2 / 2 for d in drives if d.has_rotor and self.terms.rotor]
        friction = [d.z if kind == OFFSET else ca.SX(1, 1) for kind, d in friction_terms(drives, self.terms)]
        return self.reduction.apply(ca.horzcat(links, *rotors, *friction))

    def density(self, q: ca.SX, dq: ca.SX) -> ca.SX:
        """Power lost per friction parameter, ``dz`` times its torque; that of an offset is in the state."""
        drives = drive_motions(self.robot, q, dq, ca.SX(self.robot.n, 1))
        losses = [
            ca.SX(1, 1) if kind == OFFSET else d.dz * friction_torque(kind, d, self.terms, self.sign_width)
            for kind, d in friction_terms(drives, self.terms)
        ]
        count = len(self.reduction.standard) - len(losses)
        return self.reduction.apply(ca.horzcat(ca.SX(1, count), *losses))

    def _cumulated(self, samples: Samples, columns: Index) -> Array:
        """As for any window model, but Coulomb losses come from the lengths of the drives' paths, ``int |dz| dt``."""
        cumulated = super()._cumulated(samples, columns)
        lossy = self._integrated_exactly()[columns]
        if not np.any(lossy):
            return cumulated
        spread = self._coulomb_spread[:, columns]
        rows = drive_rows(self.robot)
        drives = [rows[c.owner] for c in self.reduction.standard if c.kind == COULOMB and c.owner is not None]
        C = np.array(drives).reshape(-1, self.robot.n)
        paths = path_lengths(samples.time, samples.q @ C.T, samples.dq @ C.T)
        cumulated[0, lossy] = spread[:, lossy].T @ paths.T
        return cumulated

    @property
    def _coulomb_spread(self) -> Array:
        """Coulomb losses of the columns, each of the paths of the drives, shape (drives, p)."""
        return np.asarray(self.reduction.matrix[[column.kind == COULOMB for column in self.reduction.standard]])

    def _integrated_exactly(self) -> Mask:
        """Columns with Coulomb friction of the exact sign."""
        if not self.terms.coulomb or self.sign_width > 0.0:
            return super()._integrated_exactly()
        return np.asarray(np.any(self._coulomb_spread != 0.0, axis=0))

    def measured_density(self, samples: Samples, measured: Array) -> Array:
        """Power of the joint torques, ``tau' dq``, shape (N, 1) [W]; `measured` has shape (N, n) [Nm]."""
        return np.asarray(np.sum(measured * samples.dq, axis=1, keepdims=True))


def path_lengths(time: Array, z: Array, dz: Array) -> Array:
    """``int |dz| dt`` from the first sample on, with the exact sign also where dz changes it between samples.

    Between two samples z is the cubic that has their positions and velocities; its path goes from turning point to
    turning point.
    """  # time (N,); z, dz (N, k)
    h = np.diff(time)[:, None]
    a, b, rise = dz[:-1], dz[1:], np.diff(z, axis=0)
    # velocity of the cubic at fraction s of the interval: a + slope s + curve s^2
    curve = 3 * (a + b - 2 * rise / h)
    slope = b - a - curve
    root = np.sqrt(np.maximum(slope**2 - 4 * curve * a, 0.0))
    divisor = -0.5 * (slope + np.where(slope >= 0, root, -root))
    with np.errstate(divide="ignore", invalid="ignore"):
        turns = np.nan_to_num(np.stack([divisor / curve, a / divisor]), nan=0.0, posinf=0.0, neginf=0.0)
    turns = np.clip(turns, 0.0, 1.0)
    parts = np.stack([turns.min(axis=0), turns.max(axis=0)])
    reached = h * parts * (a + parts * (slope / 2 + parts * curve / 3))
    length = np.abs(reached[0]) + np.abs(reached[1] - reached[0]) + np.abs(rise - reached[1])
    return np.vstack([np.zeros((1, z.shape[1])), np.cumsum(length, axis=0)])

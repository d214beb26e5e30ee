"""Models of what force/torque sensors see, a load [KD96] eq. (9), (10) or a whole robot, and of a load by torques."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from regressors.arguments import checked
from regressors.errors import InputError, check_names
from regressors.models.model import RegressorModel
from regressors.models.reduction import Reduction, reduction_by
from regressors.models.windows import Window, WindowModel
from regressors.quantities import place_of
from regressors.robot.columns import Terms, body_columns
from regressors.robot.inertia import is_rotation
from regressors.robot.robot import Joint, Robot, Structure
from regressors.robot.symbolic.kinematics import (
    LinkMotion,
    bodies,
    body_regressor,
    effort_regressor,
    link_motions,
    next_link,
    sparse,
)
from regressors.samples import Array, Samples

EQUATIONS = ("fx", "fy", "fz", "nx", "ny", "nz")
LOAD_PARAMETERS = ("m", "mcx", "mcy", "mcz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
_COLUMNS = body_columns(LOAD_PARAMETERS, None)  # in the order of [KD96] eq. (10)


@checked
@dataclass(frozen=True, eq=False)
class Sensor:
    """A force/torque sensor: its frame, and the components that are used.

    Parameters
    ----------
    link : str, optional
        Link that carries the sensor, by name or number; the last one if not given.
    rotation : ndarray, shape (3, 3)
        Axes of the sensor's frame in the link's frame.
    translation : ndarray, shape (3,)
        Origin P of the sensor's frame in the link's frame [m].
    equations : tuple of str
        Selection of fx, fy, fz, nx, ny, nz.
    """

    link: str | None = None
    rotation: Array = field(default_factory=lambda: np.eye(3))
    translation: Array = field(default_factory=lambda: np.zeros(3))
    equations: tuple[str, ...] = EQUATIONS

    def __post_init__(self) -> None:
        check_names("equation", self.equations, EQUATIONS)
        if len(set(self.equations)) != len(self.equations) or not self.equations:
            raise InputError(
                f"equations: expected at least one, and each once, given {', '.join(self.equations) or 'none'}"
            )
        if not is_rotation(self.rotation):
            raise InputError(f"sensor axes are not a rotation matrix: {self.rotation.tolist()}")
        if not np.all(np.isfinite(self.translation)) or np.shape(self.translation) != (3,):
            raise InputError(
                f"sensor position must be three finite numbers, given {np.asarray(self.translation).tolist()}"
            )

    def place(self, robot: Robot) -> int:
        """Index of the link that carries the sensor.

        Raises
        ------
        UnknownName
            The robot has no such link.
        InputError
            No link is given, and the robot has several last ones.
        """
        if self.link is None:
            return robot.last_link("a force/torque sensor, unless `sensor` names its link,")
        return place_of("link of the robot for the sensor", self.link, [link.name for link in robot.links])


def _sensor_motion(robot: Robot, sensor: Sensor, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> LinkMotion:
    """Motion of the sensor's frame, in its own axes."""
    link = list(link_motions(robot, q, dq, ddq))[sensor.place(robot)]
    fixed = Joint("sensor", "prismatic", sensor.rotation, sensor.translation)
    return next_link(link, fixed, *3 * [ca.SX(1, 1)])


class SensorModel(RegressorModel):
    """A model of the wrench at a sensor, or of its integrals."""

    channel = "wrench"
    keeps_all_links = True
    _per_unit: ClassVar[str] = ""

    def __init__(self, robot: Robot, sensor: Sensor | None = None) -> None:
        self._measure(robot, sensor if sensor is not None else Sensor())
        self.sensor.place(robot)
        self.columns = _COLUMNS

    def _measure(self, robot: Robot, sensor: Sensor) -> None:
        self.robot, self.sensor = robot, sensor
        names = sensor.equations
        self.row_labels = tuple((name, ("N" if name[0] == "f" else "Nm") + self._per_unit) for name in names)
        self._equations = [EQUATIONS.index(name) for name in names]

    def _selected(self, measured: Array) -> Array:
        """Selected equations of all six components, or of the selected ones alone, shape (N, r)."""
        return measured[:, self._equations] if measured.shape[1] == len(EQUATIONS) else measured

    @property
    def options(self) -> dict[str, Any]:
        """Sensor."""
        return {"sensor": self.sensor}

    def right_side(self, samples: Samples, measured: Array) -> Array:
        """The wrench, selected equations; `measured` has shape (N, 6) or (N, r) [N, Nm]."""
        return self._selected(np.asarray(measured, dtype=float)).reshape(-1)


@checked
class LoadModel(SensorModel):
    """Wrench at the sensor, ``[F; N] = K phi`` [KD96] eq. (8), (9).

    Parameters
    ----------
    robot : Robot
    sensor : Sensor, optional
    """

    jax_form = "regressors.jax_models.jax_model:LoadPart"

    def rows(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        """Selected rows of K, shape (r, 10) [N and Nm per unit parameter]."""
        body = _sensor_motion(self.robot, self.sensor, q, dq, ddq)
        return ca.vertcat(*body_regressor(body.omega, body.domega, body.a))[self._equations, :]


@checked
class LoadIntegralModel(WindowModel, SensorModel):
    """Integrals of the wrench over time windows, ``int [F; N] dt = K_I phi`` [KD96] eq. (11)-(13).

    In the sensor's rotating axes ``dv/dt`` of eq. (9) is the rate of the components of v plus ``omega x v``; so no
    acceleration occurs.

    Parameters
    ----------
    robot : Robot
    sensor : Sensor, optional
    window : Window, optional
    """

    jax_form = "regressors.jax_models.jax_model:LoadIntegralPart"
    _per_unit = " s"

    def __init__(self, robot: Robot, sensor: Sensor | None = None, window: Window | None = None) -> None:
        super().__init__(robot, sensor)
        self.window = window if window is not None else Window()

    @property
    def options(self) -> dict[str, Any]:
        """Sensor and windows."""
        return {"sensor": self.sensor, "window": self.window}

    def instantaneous(self) -> RegressorModel:
        """Model of the wrench that this model integrates.

        Raises
        ------
        InputError
            A subclass with further columns, whose wrench is not known here.
        """
        model = LoadModel(self.robot, self.sensor)
        return model if model.columns == self.columns else super().instantaneous()

    def _body(self, q: ca.SX, dq: ca.SX) -> LinkMotion:
        return _sensor_motion(self.robot, self.sensor, q, dq, ca.SX(self.robot.n, 1))

    def state(self, q: ca.SX, dq: ca.SX) -> ca.SX:
        """Bracketed terms of K_I: ``[v, [omega x], 0; 0, -[v x], [. omega]]``, shape (r, 10)."""
        body = self._body(q, dq)
        return ca.vertcat(*body_regressor(ca.SX(3, 1), body.omega, body.v))[self._equations, :]

    def density(self, q: ca.SX, dq: ca.SX) -> ca.SX:
        """Integrands of K_I: ``omega x v - R g``, ``[omega x][omega x]``, ``[omega x][. omega]``, shape (r, 10)."""
        body = self._body(q, dq)
        w = body.omega
        a = ca.cross(w, body.v) - body.up
        return ca.vertcat(*body_regressor(w, ca.SX(3, 1), a))[self._equations, :]

    def measured_density(self, samples: Samples, measured: Array) -> Array:
        """The wrench itself, selected equations, shape (N, r) [N, Nm]; `measured` has shape (N, 6) or (N, r)."""
        return self._selected(measured)


@checked
class PayloadModel(RegressorModel):
    """Torques of all joints per parameter of a body fixed to the last link, about that link's frame.

    ``tau_j = l_j' F + s_j' N`` with ``[F; N] = K phi`` of the last link's frame [KD96] eq. (8)-(10): the difference of
    the torques with and without the body, for a robot that is known.

    Parameters
    ----------
    robot : Robot
    """

    keeps_all_links = True

    def __init__(self, robot: Robot) -> None:
        robot.last_link("a payload")
        self.robot = robot
        self.columns = _COLUMNS
        units = ("Nm" if joint.kind == "revolute" else "N" for joint in robot.joints)
        self.row_labels = tuple(zip(robot.joint_names, units, strict=True))

    def rows(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        """Torques of the joints, shape (n, 10) [Nm or N, per unit parameter]."""
        *_, last = link_motions(self.robot, q, dq, ddq)
        return effort_regressor(last)


@checked
class BaseWrenchModel(SensorModel):
    """Wrench that carries a whole robot, linear in the inertial parameters of its moving bodies.

    A force plate or a six-axis sensor below the base measures the force and moment that the ground exerts on the robot.
    With the wrench ``[F_i; N_i] = K_i theta_i`` that moves body i [KD96] eq. (8), (9), and the pose ``R_i, p_i`` of its
    frame in that of the base,

        F = sum_i R_i F_i,   N = sum_i R_i N_i + p_i x R_i F_i.

    Forces between bodies are internal: friction, transmissions and torques of motors have no part in it. The spin of
    rotors, whose reaction on the base is small where gears are high, is left out. The base, and what is fixed to it,
    adds a constant, as does the bias of the sensor: take both out before the motion begins, or identify them (`bias`).

    Parameters
    ----------
    robot : Robot
        A chain or a tree with a fixed base.
    sensor : Sensor, optional
        Its frame in that of the base, and the components that are used; it names no link.

    Raises
    ------
    InputError
        The sensor is at a link.
    """

    keeps_all_links = False
    bears_robot = True

    def __init__(self, robot: Robot, sensor: Sensor | None = None) -> None:
        if sensor is not None and sensor.link is not None:
            raise InputError(
                f"the base-wrench model has its sensor below the base, given link {sensor.link!r}; leave `sensor` out, "
                "and state its frame in that of the base by `sensor_xyz` and `sensor_rpy`"
            )
        self._measure(robot, sensor if sensor is not None else Sensor())
        mirrored = Structure(mirrored=robot.structure.mirrored)
        self.reduction: Reduction = reduction_by(robot.replace(structure=mirrored), Terms.inertial_only())
        self.columns = self.reduction.columns

    def rows(self, q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        """Selected rows of the wrench, shape (r, p) [N and Nm per unit parameter]."""
        R, t = (sparse(part) for part in (self.sensor.rotation, self.sensor.translation))
        blocks = []
        for body in bodies(self.robot, q, dq, ddq):
            force, moment = body_regressor(body.omega, body.domega, body.a)
            F = ca.mtimes(body.rotation, force)
            N = ca.mtimes(body.rotation, moment) + ca.mtimes(ca.skew(body.origin - t), F)
            blocks.append(ca.vertcat(ca.mtimes(R.T, F), ca.mtimes(R.T, N)))
        return self.reduction.apply(ca.horzcat(*blocks)[self._equations, :])

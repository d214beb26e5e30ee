"""The motion of a base in a log, and the wrench on it, as those of the six joints that carry it.

With the tracked frame at ``R_t, p_t``, which is at rotation A and place a in the frame of the base,

    R = R_t A',   p = p_t - R a,

and yaw, pitch and roll of R follow. Where an IMU is given, its integrals replace them above `_CROSSOVER`, below which
these drift: that of the angular velocity, by ``omega = E (dyaw, dpitch, droll)``, and the second one of ``R f + g`` at
the place of the accelerometer, which measures the specific force f. Constant biases of both are found on the way.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import scipy

from excite.logs.log import Log
from excite.logs.mapping import OF_BASE, LogMapping
from regressors.errors import InputError, listed_names
from regressors.robot.inertia import rotation_from_rpy
from regressors.robot.moving_base import BASE_JOINTS, steepest, turning_axes
from regressors.robot.robot import Robot
from regressors.samples import Array

# scipy.spatial is named in full, so that it is loaded where a base moves, and not with every log
_CROSSOVER = 1.0  # [Hz]
_DRIFT = 3  # degree of the polynomial that the drift of integrals is near
_UNIT = 0.05  # that the length of a quaternion may be off one


def measured_equations(
    mapping: LogMapping | None, robot: Robot, asked: Sequence[str] | None = None
) -> Sequence[str] | None:
    """Joints whose equations are used: those asked for, or those whose efforts a log has by its mapping; None for all.

    Where no wrench is measured, the base's six equations are left out: those of the other joints hold whatever acts on
    the base. Where nothing does, see `excite.identification.free_base`.

    Raises
    ------
    InputError
        The mapping has none of the efforts, or not of all joints that are asked for.
    """
    if mapping is None or mapping.base is None:
        return asked
    of_base, of_joints = robot.joint_names[: len(BASE_JOINTS)], robot.joint_names[len(BASE_JOINTS) :]
    wrench, driven = mapping.base.wrench is not None, mapping.effort is not None or mapping.current is not None
    measured = of_base * wrench + of_joints * driven
    if not measured:
        raise InputError(
            "the log mapping has neither torques of the joints nor a wrench on the base, so that the motion shows no "
            "masses; give `effort:`, or `wrench:` in `base:`"
        )
    if missing := [name for name in asked or () if name in robot.joint_names and name not in measured]:
        what = "`wrench:` in `base:`" if missing[0] in of_base else "`effort:`"
        raise InputError(f"the log mapping has no efforts of {listed_names(missing)}; give {what}")
    return asked or (None if len(measured) == robot.n else measured)


def with_base_motion(log: Log, mapping: LogMapping, robot: Robot | None) -> Log:
    """The log with the joints that carry a moving base, where its mapping has channels of one."""
    if mapping.base is None or log.base is None:
        return log
    if robot is None or not robot.base_joints:
        raise InputError(
            f"{log.source}: its mapping has a moving base (base), and here the base stands still; moving bases are for "
            "identify and verify: elsewhere take a log of the robot on a stand, whose mapping has no base"
        )
    motion = _BaseMotion(log, mapping)
    q, dq = motion.positions(robot.gravity), log.dq
    if dq is not None:
        dq = np.column_stack([np.gradient(q, log.time, axis=0), dq])
    forces, effort = motion.forces(q), log.effort
    if effort is None and mapping.base.wrench is not None:
        effort = np.zeros(log.q.shape)
    return replace(
        log,
        joints=(*BASE_JOINTS, *log.joints),
        q=np.column_stack([q, log.q]),
        dq=dq,
        effort=None if effort is None else np.column_stack([forces, effort]),
        temperature=None if log.temperature is None else np.pad(log.temperature, ((0, 0), (6, 0)), mode="mean"),
        command=None,
        base=None,
        left_out=(*log.left_out, *motion.notes),
    )


class _BaseMotion:
    """Channels of a moving base."""

    def __init__(self, log: Log, mapping: LogMapping) -> None:
        assert mapping.base is not None
        assert log.base is not None
        self.log, self.given, first = log, mapping.base.channels, 0
        self.values: dict[str, Array] = {}
        for name in self.given:
            self.values[name] = log.base[:, first : first + OF_BASE[name][0]]
            first += OF_BASE[name][0]
        self.rotation = self._rotation()

    def _rotation(self) -> scipy.spatial.transform.Rotation:
        """Axes of the base, N of them."""
        name = "quaternion" if "quaternion" in self.given else "rpy"
        values = self.values[name]
        if name == "rpy":
            tracked = scipy.spatial.transform.Rotation.from_euler("ZYX", values[:, ::-1])
        else:
            off = np.abs(np.linalg.norm(values, axis=1) - 1.0)
            if off.max() > _UNIT:
                k = int(np.argmax(off))
                raise InputError(
                    f"{self.log.source}: the quaternion of the base at {self.log.time[k]:.4g} s has the length "
                    f"{1.0 + off[k]:.3g}, expected 1; check its columns, x, y, z, w"
                )
            tracked = scipy.spatial.transform.Rotation.from_quat(values)
        return tracked * scipy.spatial.transform.Rotation.from_matrix(rotation_from_rpy(self.given[name].rpy)).inv()

    def _axes(self, name: str) -> Array:
        """Axes of a sensor in those of the base."""
        return rotation_from_rpy(self.given[name].rpy)

    def positions(self, gravity: Array) -> Array:
        """Positions of the joints that carry the base, shape (N, 6)."""
        time, given, turned = self.log.time, self.given, np.unwrap(self.rotation.as_euler("ZYX"), axis=0)
        steepest(self.log.source, time, turned[:, 1])
        p = self.values["position"] - self.rotation.apply(given["position"].xyz)
        if "angular_velocity" in given:
            omega = self.values["angular_velocity"] @ self._axes("angular_velocity").T
            to_rates = np.linalg.inv(turning_axes(turned))
            turned = _fused(time, turned, *(_integral(time, to_rates @ x) for x in _with_biases(omega)))
        if "specific_force" in given:
            force, place = self.values["specific_force"] @ self._axes("specific_force").T, given["specific_force"].xyz
            R = self.rotation.as_matrix()
            there = scipy.spatial.transform.Rotation.from_euler("ZYX", turned).apply(place)
            own, *biases = (_integral(time, _integral(time, R @ x)) for x in _with_biases(force))
            falling = np.outer((time - time[0]) ** 2 / 2, gravity)
            p = _fused(time, p + there, own + falling, *biases) - there
        return np.column_stack([p, turned])

    def forces(self, q: Array) -> Array:
        """Forces at these joints that amount to the wrench, ``[R F; E' N]``, shape (N, 6); zero where there is none."""
        if "wrench" not in self.given:
            return np.zeros(q.shape)
        section, axes = self.given["wrench"], self._axes("wrench")
        if not np.any(self.values["wrench"]):
            raise InputError(
                f"{self.log.source}: the wrench on the base is zero; where nothing touches the robot, leave out "
                "`wrench:`, and state `free: true` in `base:`"
            )
        F, N = self.values["wrench"][:, :3] @ axes.T, self.values["wrench"][:, 3:] @ axes.T
        N = N + np.cross(section.xyz, F)
        return np.column_stack([self.rotation.apply(F), np.einsum("tij,ti->tj", turning_axes(q[:, 3:]), N)])

    @property
    def notes(self) -> tuple[str, ...]:
        """What the motion of the base is from."""
        rates = [name.replace("_", " ") for name in ("angular_velocity", "specific_force") if name in self.given]
        more = f", above {_CROSSOVER:g} Hz from {' and '.join(rates)}" if rates else ""
        return (f"motion of the base from its pose{more}",)


def _with_biases(measured: Array) -> Iterator[Array]:
    """What a sensor measured, and a unit bias of each of its axes, shapes (N, 3, 1)."""
    yield measured[:, :, None]
    for axis in np.eye(3):
        yield np.broadcast_to(axis, measured.shape)[:, :, None]


def _integral(time: Array, rates: Array) -> Array:
    """Integrals of rates from the first instant on, of the splines through them, shape (N, 3)."""
    return np.asarray(scipy.interpolate.CubicSpline(time, rates.reshape(-1, 3)).antiderivative()(time))


def _fused(time: Array, x: Array, integral: Array, *biases: Array) -> Array:
    """Positions whose fast part is that of an integral, which drifts, and whose slow part is the measured one's.

    The drift is a polynomial of time, and what constant biases of the sensor make.
    """
    # time (N,); x, integral, and what each bias makes (N, 3)
    left = x - integral
    basis = np.polynomial.legendre.legvander(2 * (time - time[0]) / (time[-1] - time[0]) - 1, _DRIFT)
    columns = np.column_stack([np.kron(np.eye(3), basis), *(bias.T.ravel() for bias in biases)])
    drift = (columns @ np.linalg.lstsq(columns, left.T.ravel(), rcond=None)[0]).reshape(3, -1).T
    step = float(np.median(np.diff(time)))
    sos = scipy.signal.butter(2, min(2 * _CROSSOVER * step, 0.9), output="sos")
    return np.asarray(integral + drift + scipy.signal.sosfiltfilt(sos, left - drift, axis=0))

"""Points of a friction curve: torque over speed, and their deviations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from excite.design.friction_runs.pose import gravity_of
from excite.friction.constant_speed_windows import ConstantWindow
from excite.identification.identification import Identification
from excite.information.target import target_of
from excite.logs.log import Log
from excite.registry import name_of
from regressors.errors import InputError
from regressors.models.differential import DifferentialModel
from regressors.models.nominal import standard_values
from regressors.robot.columns import ROTOR, Terms, drive_column
from regressors.robot.friction.load_and_temperature import drives_with_friction
from regressors.robot.locked_joints import with_locked_joints
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

_SAME_SPEED = 0.05
_COMMON_PATH = 0.5
_TAU_LAGS = 0.2  # of a window's samples: the largest lag of the correlation
_END, _FEWEST, _MOST = 0.05, 8, 3  # ends for speeds: length [s]; least samples; at most a third of a window
_SURE = 3.0  # standard deviations


@dataclass(frozen=True)
class Point:
    """Friction torque in one window."""

    # path increment over time, with its sign; of a break-away zero, with the sign of its direction [rad/s or m/s]
    speed: float
    torque: float  # mean friction torque [Nm or N]
    deviation: float  # standard deviation of the mean, from the residual in the window and its correlation in time
    time: float  # where the window begins in its log, and how long it is [s]
    duration: float
    log: int  # number of the log
    temperature: float | None = None  # [deg C]
    load: float | None = None  # mean size of the torque that the drive carries, by the model [Nm or N]


@dataclass(frozen=True, eq=False)
class DriveLog:
    """A log in drive coordinates, ``z = C q``, ``tau_q = C' tau_z``, for the joints that it has."""

    robot: Robot  # of the log's joints
    log: Log
    names: tuple[str, ...]  # drives, k of them
    rows: Array  # (k, n) their rows of C; linearly independent
    number: int = 0  # of the log

    @property
    def z(self) -> Array:
        """Coordinates of the drives, shape (N, k)."""
        return np.asarray(self.log.q @ self.rows.T)

    def torque(self, tau: Array) -> Array:
        """Torques of the drives from those of the joints, shape (N, k)."""
        return np.asarray(np.linalg.lstsq(self.rows.T, tau.T, rcond=None)[0].T)


def drive_log(log: Log, robot: Robot, number: int = 0) -> DriveLog:
    """A log in coordinates of the robot's drives; of drives that depend linearly on each other the first is kept."""
    joints = [name for name in robot.joint_names if name in log.joints]
    if not joints:
        raise InputError(
            f"{log.source}: robot {robot.name} has none of its joints {', '.join(log.joints)}; the robot's joints: "
            f"{', '.join(robot.joint_names)}"
        )
    if log.effort is None:
        raise InputError(f"{log.source}: it has no torques (NAME.effort), from which friction is fitted")
    part = with_locked_joints(robot, [robot.joint_names.index(name) for name in joints])
    names, rows = [], np.zeros((0, part.n))
    for name, row in drives_with_friction(part):
        if np.linalg.matrix_rank(np.vstack([rows, row])) > len(rows):
            names.append(name)
            rows = np.vstack([rows, row])
    return DriveLog(part, log.of(joints), tuple(names), rows, number)


def points_of(
    measured: DriveLog,
    drive: str,
    windows: Sequence[ConstantWindow],
    rigid: RigidModel | None,
    *,
    folded: bool = False,
    settling: bool = False,
) -> tuple[Point, ...]:
    """Mean friction torque of each window, the torque of the robot without friction subtracted.

    The motion in the window is a parabola through the positions, one of each joint. Where a speed still settles at one
    end, as under a soft controller, the mean acceleration is that from end to end, ``(dq(t2) - dq(t1)) / (t2 - t1)``,
    so that no change of kinetic energy [KD96] eq. (19) counts as friction.
    """
    points = []
    for w in windows:
        carried = np.zeros(1) if rigid is None else _carried(measured, drive, w, rigid)
        point = _point(measured, drive, w, _torque(measured, drive, w) - carried, folded=folded)
        if rigid is not None and settling:
            point = _settled(point, measured, drive, w, rigid, carried)
        points.append(point if rigid is None else replace(point, load=float(np.mean(np.abs(carried)))))
    return tuple(points)


def paired_points(measured: DriveLog, drive: str, windows: Sequence[ConstantWindow]) -> tuple[Point, ...]:
    """Half the difference of torques there and back over the same path, without gravity, at positive speeds."""
    k = measured.names.index(drive)
    z, time = measured.z[:, k], measured.log.time
    points, left = [], [w for w in windows if w.speed < 0]
    for ahead in (w for w in windows if w.speed > 0):
        matches = [
            (common, back)
            for back in left
            if abs(ahead.speed + back.speed) <= _SAME_SPEED * ahead.speed
            and (common := _common(z, ahead, back)) is not None
        ]
        if not matches:
            continue
        (low, high), back = max(matches, key=lambda match: match[0][1] - match[0][0])
        left.remove(back)
        parts = [_within(z, time, w, low, high) for w in (ahead, back)]
        pair = [_point(measured, drive, w, _torque(measured, drive, w)) for w in parts]
        point = replace(
            half_difference(*pair),
            speed=0.5 * (pair[0].speed - pair[1].speed),
            duration=pair[0].duration + pair[1].duration,
            temperature=_mean([p.temperature for p in pair]),
        )
        points.append(point)
    return tuple(points)


def half_difference(ahead: Point, back: Point) -> Point:
    """The first point with half the difference of both torques: without what is the same in both directions."""
    deviation = 0.5 * float(np.hypot(ahead.deviation, back.deviation))
    return replace(ahead, torque=0.5 * (ahead.torque - back.torque), deviation=deviation)


def gravity_share(measured: DriveLog, drive: str, windows: Sequence[ConstantWindow], rigid: RigidModel) -> float:
    """Largest mean torque without friction of any window, relative to the median of the measured ones."""
    if not windows:
        return 0.0
    raw = np.array([np.mean(_torque(measured, drive, w)) for w in windows])
    carried = np.array([np.mean(_carried(measured, drive, w, rigid)) for w in windows])
    return float(np.abs(carried).max() / max(float(np.median(np.abs(raw))), 1e-12))


def _torque(measured: DriveLog, drive: str, window: ConstantWindow) -> Array:
    """Torque of the drive over a window."""
    assert measured.log.effort is not None
    return measured.torque(measured.log.effort[window.start : window.stop])[:, measured.names.index(drive)]


def _carried(
    measured: DriveLog, drive: str, window: ConstantWindow, rigid: RigidModel, more: Array | float = 0.0
) -> Array:
    """Torque of the drive over a window without friction, with some additional acceleration."""
    part = slice(window.start, window.stop)
    dq, acceleration = _parabola(*_positions(measured, part, rigid))
    return rigid_torque(measured, drive, part, rigid, dq, acceleration + more)


def _positions(measured: DriveLog, rows: slice, rigid: RigidModel) -> tuple[Array, Array]:
    """Instants, and positions of the model's joints."""
    columns = [measured.log.joints.index(name) for name in rigid.joints]
    return measured.log.time[rows], measured.log.q[rows][:, columns]


def rigid_torque(
    measured: DriveLog, drive: str, rows: slice, rigid: RigidModel, dq: Array | float, ddq: Array | float
) -> Array:
    """Torque of the drive without friction in some rows, for given velocities and accelerations, shape (N,)."""
    time, q = _positions(measured, rows, rigid)
    dq, ddq = (np.array(np.broadcast_to(x, q.shape)) for x in (dq, ddq))
    tau = np.zeros((q.shape[0], len(measured.log.joints)))
    columns = [measured.log.joints.index(name) for name in rigid.joints]
    tau[:, columns] = rigid.torque(Samples(time, q, dq, ddq, np.full_like(q, np.nan)))
    return measured.torque(tau)[:, measured.names.index(drive)]


def _parabola(time: Array, q: Array) -> tuple[Array, Array]:
    """Velocities, shape (N, n), and accelerations, shape (n,), of parabolas through positions."""
    middle, half = 0.5 * (time[0] + time[-1]), 0.5 * (time[-1] - time[0])
    s = (time - middle) / half
    c = np.linalg.lstsq(np.column_stack([np.ones_like(s), s, s**2]), q, rcond=None)[0]
    return (c[1] + 2.0 * np.outer(s, c[2])) / half, 2.0 * c[2] / half**2


def _end_velocity(time: Array, q: Array, at: int) -> tuple[Array, Array]:
    """Velocities at one end of parabolas through positions, and their standard deviations, shape (n,)."""
    s = time - time[at]
    Q, R = np.linalg.qr(np.column_stack([np.ones_like(s), s, s**2]))
    left = q - Q @ (Q.T @ q)
    noise = np.sqrt(np.sum(left**2, axis=0) / (s.size - 3))
    return np.linalg.solve(R, Q.T @ q)[1], noise * float(np.linalg.norm(np.linalg.solve(R.T, [0.0, 1.0, 0.0])))


def _settled(
    point: Point, measured: DriveLog, drive: str, window: ConstantWindow, rigid: RigidModel, carried: Array
) -> Point:
    """A point with the mean acceleration between the window's ends, where the difference exceeds noise."""
    time, q = _positions(measured, slice(window.start, window.stop), rigid)
    count = max(_FEWEST, round(_END / float(np.median(np.diff(time)))))
    if count > time.size // _MOST:
        return point
    first, last = _end_velocity(time[:count], q[:count], 0), _end_velocity(time[-count:], q[-count:], -1)
    duration = float(time[-1] - time[0])
    more = (last[0] - first[0]) / duration - _parabola(time, q)[1]
    doubt = np.hypot(first[1], last[1]) / duration
    sure = float(np.max(np.abs(more) / np.maximum(doubt, 1e-12)))
    if sure < _SURE:
        return point
    less = float(np.mean(_carried(measured, drive, window, rigid, more) - carried))
    return replace(point, torque=point.torque - less, deviation=float(np.hypot(point.deviation, less / sure)))


def _point(measured: DriveLog, drive: str, window: ConstantWindow, friction: Array, *, folded: bool = False) -> Point:
    log = measured.log
    time = log.time[window.start : window.stop]
    duration = float(time[-1] - time[0])
    return Point(
        speed=window.speed,
        torque=float(np.trapezoid(friction, time)) / duration,
        deviation=mean_deviation(_folded(friction) if folded else friction),
        time=float(time[0]),
        duration=duration,
        log=measured.number,
        temperature=temperature_of(measured, drive, slice(window.start, window.stop)),
    )


def _folded(x: Array) -> Array:
    """Means of the values at equal distances from the middle."""
    half = x.size // 2
    return 0.5 * (x[:half] + x[: -half - 1 : -1])


def mean_deviation(x: Array) -> float:
    """Deviation of a window's mean, ``s^2 (1 + 2 sum rho_k) / n``, with a trend removed; rho where it shows."""
    # x (n,)
    n = x.size
    s = np.linspace(-1.0, 1.0, n)
    r = x - np.mean(x) - s * (s @ x) / (s @ s)
    power = float(r @ r)
    if power <= 1e-24 * float(x @ x):
        return 1e-12 * float(np.abs(x).max(initial=1e-12))
    spectrum = np.fft.rfft(r, 2 * n)
    rho = np.fft.irfft(np.abs(spectrum) ** 2)[1 : max(2, int(_TAU_LAGS * n))] / power
    small = np.flatnonzero(rho < 2.0 / np.sqrt(n))
    factor = 1.0 + 2.0 * float(rho[: small[0] if small.size else rho.size].sum())
    return float(np.sqrt(power / max(n - 2, 1) * factor / n))


def _common(z: Array, a: ConstantWindow, b: ConstantWindow) -> tuple[float, float] | None:
    """Path that two windows have in common, where it is half of the shorter one or more."""
    ranges = [(float(z[w.start : w.stop].min()), float(z[w.start : w.stop].max())) for w in (a, b)]
    low, high = max(r[0] for r in ranges), min(r[1] for r in ranges)
    return (low, high) if high - low >= _COMMON_PATH * min(r[1] - r[0] for r in ranges) else None


def _within(z: Array, time: Array, window: ConstantWindow, low: float, high: float) -> ConstantWindow:
    part = z[window.start : window.stop]
    inside = window.start + np.flatnonzero((part >= low) & (part <= high))
    a, b = int(inside[0]), int(inside[-1]) + 1
    return ConstantWindow(a, b, float((z[b - 1] - z[a]) / (time[b - 1] - time[a])))


def temperature_of(measured: DriveLog, drive: str, rows: slice) -> float | None:
    """Mean temperature of the joint that the drive moves first, over some rows [deg C]."""
    if measured.log.temperature is None:
        return None
    row = measured.rows[measured.names.index(drive)]
    column = int(np.flatnonzero(row)[-1])
    return float(np.mean(measured.log.temperature[rows, column]))


def _mean(values: list[float | None]) -> float | None:
    known = [v for v in values if v is not None]
    return float(np.mean(known)) if len(known) == len(values) else None


_LOOKED_AT = 50  # poses of a log that are checked
_NOTHING = 1e-8  # Nm or N


def never_loaded(measured: DriveLog, drive: str) -> bool:
    """Whether gravity exerts no torque on a drive in the poses of a log, even if masses are unknown.

    With torques ``tau_q = C' tau_z`` the drive's is ``N' tau_q``, N the column of the inverse of C that moves it alone.
    """
    line = np.linalg.pinv(measured.rows.T)[measured.names.index(drive)]
    rows = np.unique(np.linspace(0, measured.log.count - 1, _LOOKED_AT).astype(int))
    columns = [measured.log.joints.index(name) for name in measured.robot.joint_names]
    torque = gravity_of(measured.robot)(line, measured.log.q[rows][:, columns])
    return bool(np.all(np.abs(torque) <= _NOTHING))  # False where it is unknown (NaN)


@dataclass(frozen=True, eq=False)
class RigidModel:
    """Joint torques of a motion without friction, ``D(q, dq, ddq) X`` of [KD96] eq. (21)."""

    joints: tuple[str, ...]  # joints of the model; the others rest
    source: str  # where its parameters are from
    torque: Callable[[Samples], Array]  # (N, n) from `Samples` of these joints to torques, shape (N, n) [Nm or N]


def described_model(robot: Robot) -> RigidModel:
    """Model with the parameters of the robot's description."""
    known = standard_values(robot)
    drives = () if robot.transmission is None else robot.transmission.drives
    rotor = bool(drives) and all(
        drive_column(k, ROTOR).name in known or drive.rests for k, drive in enumerate(drives, 1)
    )
    model = DifferentialModel(robot, replace(Terms.inertial_only(), rotor=rotor))
    definition, names = model.definition()
    needed = np.any(definition != 0.0, axis=0)
    missing = [name for name, wanted in zip(names, needed, strict=True) if wanted and name not in known]
    if missing:
        raise InputError(
            f"gravity is to be subtracted, but the description of {robot.name} does not state "
            f"{', '.join(missing[:6])}{' ...' if len(missing) > 6 else ''}: give `parameters`, the result of "
            "`identify`; or record runs over the same path in both directions and give `gravity='symmetric'`; or give "
            "the `plan` of `plan_friction` about a pose in which gravity cancels"
        )
    values = definition @ np.array([known.get(name, 0.0) for name in names])
    source = f"described parameters of {robot.name}" + ("" if rotor else ", without rotors")
    return RigidModel(robot.joint_names, source, lambda s: (model.instants(s) @ values).reshape(-1, robot.n))


def identified_model(result: Identification, robot: Robot) -> RigidModel:
    """Model with the parameters of a result, its friction left out."""
    if result.robot.sha256() != robot.sha256():
        raise InputError(f"{result.name} is a result for {result.robot.name}, not for {robot.name} as given here")
    target = target_of(result.robot, result.task, 0.0, instantaneous=True)
    model, base = target.model, target.base
    if not model.rows_are_joint_torques:
        name = name_of(result.task.model.model)
        raise InputError(f"{result.name}: a result of the {name} model does not give the torques of every joint")
    columns = np.array([column.group == "friction" for column in model.columns])
    of_friction = columns[base.index]
    if np.any(base.D[np.ix_(~of_friction, columns)]):
        raise InputError(f"{result.name}: friction cannot be separated from its other parameters")
    values = np.where(of_friction, 0.0, result.coefficients)

    joints, n = target.robot.joint_names, target.robot.n
    torque = lambda s: (model.instants(s)[:, base.index] @ values).reshape(-1, n)  # noqa: E731
    return RigidModel(joints, f"parameters identified in {result.name}", torque)

"""The motion that identified servos make of periodic commands, by gain and phase, so that a search can follow it.

About a pose, with the arm's own inertia M_jj at the joint, but without friction, gravity, the other joints and limits
of torque, a servo is ``(M_jj + J) ddq = K (u(t - d) - q) - D dq``, which follows a command of the frequency w by

    ``H(w) = K exp(-i w d) / (K + i w D - w^2 (M_jj + J))``
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from excite.tasks.stored_files import TaskServos
from excite.trajectories.family import JointMotion
from regressors.errors import InputError, listed_names
from regressors.models.servo_response import SYMBOLS, arm_torques
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples


@dataclass(frozen=True, eq=False)
class LinearServos:
    """Servos of joints as linear filters."""

    K: Array  # (n,) [Nm/rad]
    D: Array  # (n,) [Nm s/rad]
    inertia: Array  # (n,) of drive and arm [kg m^2]
    delay: Array  # (n,) [s]
    period: float  # of the commands [s]

    @classmethod
    def of(cls, servos: TaskServos, robot: Robot, pose: Array, period: float) -> LinearServos:
        """Of the joints of a moving robot, about a pose."""
        if lacking := [name for name in robot.joint_names if name not in servos.joints]:
            raise InputError(f"servos {servos}: nothing is known of the servo of {listed_names(lacking)}, which moves")
        values = np.array([servos.values[servos.joints.index(name)] for name in robot.joint_names])
        K, D, J, d = (values[:, SYMBOLS.index(symbol)] for symbol in "KDJd")
        rest = np.zeros((1, robot.n))
        return cls(K, D, J + arm_torques(robot)(pose[None], rest, rest)[1][0], d, period)

    def response(self, count: int) -> Array:
        """H at the frequencies of a real Fourier transform of so many instants, shape (n, count // 2 + 1)."""
        w = 2.0 * np.pi / self.period * np.arange(count // 2 + 1)[:, None]
        H = self.K * np.exp(-1j * w * self.delay) / (self.K + 1j * w * self.D - w**2 * self.inertia)
        return np.asarray(H.T)

    def motion(self, told: JointMotion, count: int) -> JointMotion:
        """The motion at even instants of a period, from that of the commands."""
        H = self.response(count)

        def pullback(x: Array, slopes: Sequence[Array]) -> Array:
            return told.pullback(x, [_through(H.conj(), each) for each in slopes])

        return JointMotion(lambda x: [_through(H, each) for each in told.values(x)], pullback)

    def samples(self, told: Samples) -> Samples:
        """The motion at even instants from the beginning to the end of a period."""
        H = self.response(told.time.size - 1)
        states = (_through(H, each[:-1].T).T for each in (told.q, told.dq, told.ddq))
        q, dq, ddq = (np.vstack([each, each[:1]]) for each in states)
        return replace(told, q=q, dq=dq, ddq=ddq)


def _through(H: Array, values: Array) -> Array:
    """Periodic signals, of shape (n, T), through filters."""
    return np.asarray(scipy.fft.irfft(H * scipy.fft.rfft(values), values.shape[1]))

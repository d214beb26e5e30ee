"""One simulated run measured again and again: the same motion and torques, other noise, other steps of the encoders."""

from __future__ import annotations

import numpy as np

from excite.logs.log import Log
from excite.simulation.sensors import noisy, quantised
from excite.simulation.simulation import Simulation

_SHIFT = 1e-4  # rad, many counts of an encoder: where its steps lie is then random


def remeasured(found: Simulation, counts: float, torque_noise: float, seed: int) -> Log:
    """Log of a simulated run as another measurement of it would be.

    Parameters
    ----------
    found : Simulation
    counts : float
        Of the encoders, per revolution of the motors.
    torque_noise : float
        Standard deviation of white noise on every torque [Nm].
    seed : int
    """
    rng = np.random.default_rng(seed)
    samples = found.run.samples
    shift = rng.uniform(0.0, _SHIFT, samples.q.shape[1])
    return Log(
        source=f"measurement {seed}",
        sha256="",
        joints=found.robot.joint_names,
        time=samples.time,
        q=quantised(found.robot, samples.q + shift, (counts,)) - shift,
        effort=noisy(found.run.effort, (torque_noise,), "torque_noise", rng),
    )

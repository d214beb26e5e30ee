"""Run of a robot with closed loops: it follows its motion exactly, and its drives have the torques which that takes.

``N' tau`` is determined by the motion. Where drives act on more joints than move on their own, their torques are those
of the least norm: what they bear against each other is not determined by a motion.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import scipy

from excite.simulation.integration import SimulatedRun, Steps
from excite.simulation.plant import Plant
from excite.simulation.settings import SimulationSettings
from excite.tasks.reference import Reference
from regressors.errors import InputError
from regressors.robot.friction.load_and_temperature import smooth_direction
from regressors.robot.symbolic.loops import loops_of
from regressors.robot.symbolic.vectorised import program
from regressors.samples import Array

_SOFTEST = 1e-6  # of the largest velocity: the sign of friction changes within it; nothing is integrated
NOTE = (
    "closed loops: the robot follows its motion exactly, and its drives have the torques which that takes; no "
    "controller is simulated"
)


def closed_run(plant: Plant, motion: Reference, settings: SimulationSettings) -> tuple[SimulatedRun, Steps]:
    """Torques of the drives along a motion that keeps the loops closed."""
    if settings.impact or settings.breakaway is not None or plant.friction.loaded:
        raise InputError(
            f"robot {plant.robot.name!r}: impacts, presliding and friction that grows with the load are not simulated "
            "for closed loops; leave `impact`, `breakaway` and such friction out"
        )
    loops, count = loops_of(plant.robot), round(motion.duration * settings.rate) + 1
    given = motion.samples(np.arange(count) / settings.rate)
    solved, left = loops.solved(given.q[:, loops.independent])
    loops.check(given.time, solved, left, plant.robot.name)
    samples = loops.rates(replace(given, q=solved, dddq=np.zeros_like(solved)))
    q, dq, ddq = (x.T for x in (samples.q, samples.dq, samples.ddq))
    width = settings.sign_width or _SOFTEST * (float(np.abs(dq).max()) or 1.0)
    symbol = ca.SX.sym("dq", plant.robot.n)
    lost = plant.friction.joint_expression(plant.robot, symbol, smooth_direction(plant.robot, symbol, width))
    friction = program(ca.Function("friction", [symbol], [ca.densify(lost)]))((dq,)).T
    rigid = program(plant.torque)((q, dq, ddq)).T
    effort = loops.drive_torques(samples.q, rigid + friction)
    work, loss = (_cumulated(samples.time, np.sum(tau * samples.dq, axis=1)) for tau in (effort, friction))
    energy = program(plant.energy)((q, dq))[0]
    run = SimulatedRun(samples, effort, effort.copy(), friction, work, loss, energy)
    return run, Steps(1, width)


def _cumulated(time: Array, power: Array) -> Array:
    return np.asarray(scipy.integrate.cumulative_simpson(power, x=time, initial=0.0))

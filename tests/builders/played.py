"""Logs of motions played without noise, their torques by Pinocchio and by hand, for the tests of identification."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
from motions import Sines
from pinocchio_chains import chain_model, inertia

from excite.design.design_folder import save_design
from excite.design.design_json import load_design
from excite.design.optimisation import design_trajectory
from excite.identification.identification import Identification
from excite.identification.procedure import estimate_parameters
from excite.identification.recipe import Recipe
from excite.identification.result import reference_of
from excite.logs.log import Log
from excite.logs.log_reading import write_log
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from regressors.readers.library import built_in
from regressors.robot.friction.curve import CoulombViscous
from regressors.robot.locked_joints import with_locked_joints
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

PERIOD = 2.0
LOAD = np.array([1.76, 0.02, 0.01, 0.16, 0.02, 0.001, 0.0, 0.03, 0.0, 0.012])
TASK = Task("irp6")
EXACT = Recipe(signals="fourier", period=PERIOD, harmonics=3, rows="all")


@cache
def irp6() -> Robot:
    return built_in("irp6")


def periodic(moved: Array, seed: int, size: float = 0.16) -> Sines:
    """Motion of period 2 s in the directions of the rows of ``moved``, shape (k, n), about zero."""
    rng = np.random.default_rng(seed)
    k, n = moved.shape
    amplitude = size * rng.uniform(0.4, 1.0, (k, 3)) / np.arange(1, 4)
    phase = rng.uniform(0, 2 * np.pi, 3)  # alike for all, so that directions stay directions
    spread = moved.T @ (amplitude * rng.choice([-1.0, 1.0], (k, 3)))
    if k > 1:
        return Sines(np.zeros(n), spread, np.pi * np.arange(1, 4), rng.uniform(0, 2 * np.pi, (n, 3)))
    return Sines(np.zeros(n), spread, np.pi * np.arange(1, 4), np.tile(phase, (n, 1)))


def torques(robot: Robot, samples: Samples, drives: int, load: Array | None = None) -> Array:
    """Joint torques by Pinocchio's recursion, and of the first rotors and frictions drive by drive, shape (N, n)."""
    model = chain_model(robot)
    if load is not None:
        model.appendBodyToJoint(model.njoints - 1, inertia(load), pin.SE3.Identity())
    data = model.createData()
    tau = np.array(
        [pin.rnea(model, data, *state).copy() for state in zip(samples.q, samples.dq, samples.ddq, strict=True)]
    )
    for drive, row in list(zip(robot.transmission.drives, robot.transmission.coupling, strict=True))[:drives]:
        dz, ddz = samples.dq @ row, samples.ddq @ row
        motor = drive.ratio.value**2 * drive.rotor_inertia * ddz
        tau += np.outer(motor + drive.coulomb * np.sign(dz) + drive.viscous * dz, row)
    return tau


def wrench(robot: Robot, samples: Samples, load: Array) -> Array:
    """Force and moment on a load at the last link's frame, by Pinocchio, shape (N, 6)."""
    bare = replace(robot, links=tuple(replace(link, theta=None) for link in robot.links))
    model = chain_model(bare)
    model.appendBodyToJoint(model.njoints - 1, inertia(load), pin.SE3.Identity())
    data = model.createData()
    found = []
    for state in zip(samples.q, samples.dq, samples.ddq, strict=True):
        pin.rnea(model, data, *state)
        found.append(np.concatenate([data.f[-1].linear, data.f[-1].angular]))
    return np.array(found)


def played(
    motion: Sines | AtRest,
    joints: int,
    rate: float = 200.0,
    seconds: float = PERIOD,
    load: Array | None = None,
    source="LOG",
) -> Log:
    """Log of the first joints of the IRp-6, noise-free; with a load, its wrench too."""
    samples = motion.samples(np.arange(round(rate * seconds)) / rate)
    robot = irp6()
    return Log(
        source,
        f"{source} at {rate}",
        robot.joint_names[:joints],
        samples.time,
        samples.q[:, :joints],
        samples.dq[:, :joints],
        torques(robot, samples, 5, load)[:, :joints],
        None if load is None else wrench(robot, samples, load),
    )


def noisy(log: Log, torque: float, position: float, seed: int) -> Log:
    """The same with white noise [Nm, rad]."""
    rng = np.random.default_rng(seed)
    assert log.effort is not None
    return replace(
        log,
        q=log.q + position * rng.normal(size=log.q.shape),
        effort=log.effort + torque * rng.normal(size=log.effort.shape),
        sha256=f"{log.sha256} {seed}",
    )


@dataclass(frozen=True)
class AtRest:
    """A motion of the first three joints while the others rest."""

    moving: Trajectory

    def samples(self, time: Array) -> Samples:
        """Of all five joints; from its end on the motion begins anew."""
        motion = self.moving.samples(np.mod(time, self.moving.duration))
        rest = np.zeros((time.size, 2))
        return Samples(time, *(np.hstack([getattr(motion, name), rest]) for name in ("q", "dq", "ddq", "dddq")))


def three_joints(seed: int = 1) -> Sines:
    """Motion of the first three joints of the IRp-6."""
    return periodic(np.eye(5)[:3], seed)


def found(task: Task, *logs: Log, recipe: Recipe = EXACT, **more) -> Identification:
    """Identification of the IRp-6."""
    return estimate_parameters(irp6(), task, logs, recipe, **more)


def curves() -> dict[str, CoulombViscous]:
    """Friction of the IRp-6's first drives as described, while the wrist is locked."""
    drives = with_locked_joints(irp6(), [0, 1, 2]).transmission.drives
    return {d.name: CoulombViscous(d.coulomb, d.viscous) for d in drives if not d.rests}


def described(result: Identification) -> Array:
    """Base parameters as the robot's description states them."""
    return reference_of(result.target, [part.log for part in result.prepared]).values


def mixed(*rows: Array) -> Array:
    """Directions of motion of the first three joints, as directions of all five."""
    return np.column_stack([np.array(rows), np.zeros((len(rows), 2))])


FRICTION = "schema: excite.friction/1\ndrives:\n" + "".join(
    f"  {name}: {{model: coulomb-viscous, coulomb: {curve.coulomb}, viscous: {curve.viscous}}}\n"
    for name, curve in curves().items()
)


def write_files(folder: Path) -> None:
    """``design``; ``run.csv`` and ``again.csv`` of it, ``other.csv``, ``load.csv`` of other motions; friction."""
    task = Task("irp6", period=4.0, harmonics=3, starts=1, executor="serial")
    save_design(design_trajectory(task.changed(robot=irp6())), folder / "design")
    motion = AtRest(load_design(folder / "design").trajectory)
    for seed, name in enumerate(("run", "again")):
        write_log(noisy(played(motion, 3, 100.0, 4.01), 0.2, 1e-6, seed), folder / f"{name}.csv")
    write_log(noisy(played(three_joints(), 3), 0.2, 1e-6, 2), folder / "other.csv")
    write_log(played(periodic(np.eye(5), 3), 5, load=LOAD), folder / "load.csv")
    (folder / "friction.yaml").write_text(FRICTION, encoding="utf-8")


def link_files(files: Path, folder: Path) -> None:
    """The same files in the folder of one test."""
    for path in files.iterdir():
        (folder / path.name).symlink_to(path)

"""Servos identified by MuJoCo's own toolbox, `mujoco.sysid`, and here: errors on unseen logs, and CPU time.

``python benchmarks/servo/rivals.py --real FOLDER --seeds 200-202 [--rounds 3,10,20] [--step 0.004]``: FOLDER holds the
unpacked logs of a real SO-101, see real_arm.py; the seeds are servos in MuJoCo, see coverage.py. MuJoCo's toolbox
needs ``absl-py``, ``colorama`` and ``tabulate``.

The rival has position actuators on the arm of the same URDF. Of each joint the stiffness, damping, armature, friction
loss, torque limit, offset and delay are free; they start in the middle of what the simulated servos are drawn from. It
simulates each log of the training from its first row on, and takes as many iterations as a budget of rounds allows.
"""

from __future__ import annotations

import argparse
import copy
import os
import sys
import time
from collections.abc import Sequence
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

os.environ |= {"OPENBLAS_NUM_THREADS": "1"}
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import mujoco
import numpy as np
import record
from coverage import DURATION, MIDDLE, UNSEEN, URDF
from mujoco import sysid
from plant import Truth, motion, plant, play, random_truth
from real_arm import TRAINING, UNSEEN as UNSEEN_LOGS

from excite.identification.procedure import log_of
from excite.identification.servos import identify_servos, servo_motion
from excite.logs.log import Log
from excite.verification.verify_servos import predict_motion
from regressors.readers.library import load_robot
from regressors.samples import Array

ROBOT = load_robot("so101")
JOINTS, N = ROBOT.joint_names, ROBOT.n
DIFFERENCE = 1e-4  # for derivatives of the rival
LOGARITHMS = {  # start, least and most of what is positive
    "K": (15.0, 1.0, 300.0), "D": (0.6, 1e-3, 30.0), "J": (0.01, 1e-5, 1.0), "Fc": (0.1, 1e-4, 5.0),
    "L": (2.0, 0.05, 50.0),
}  # fmt: skip
OTHERS = {"b": (0.0, -0.2, 0.2), "d": (0.02, 0.0, 0.12)}


class Rival:
    """`mujoco.sysid` with the servos of the arm as unknowns."""

    def __init__(self, logs: Sequence[Log], step: float) -> None:
        middle = Truth(*(np.full(N, start) for start, _, _ in LOGARITHMS.values()), np.zeros(N), 0.0)
        self.arm = plant(Path(str(distribution("example-robot-data").locate_file(URDF))), JOINTS, middle)
        self.arm.opt.timestep = step
        self.arm.dof_solref[:] = [2 * step, 1.0]
        self.transform = sysid.SignalTransform(normalize=False)
        self.trajectories = [self.trajectory(log) for log in logs]
        self.unknowns = sysid.ParameterDict()
        for name, limits in LOGARITHMS.items():
            self.unknowns.add(sysid.Parameter(name, *(np.full(N, np.log(value)) for value in limits)))
        for name, limits in OTHERS.items():
            self.unknowns.add(sysid.Parameter(name, *(np.full(N, value) for value in limits)))

    def trajectory(self, log: Log) -> sysid.SystemTrajectory:
        """A log as the toolbox has it, from the state that is measured first."""
        assert log.command is not None
        speed, time_ = servo_motion(log, ROBOT).samples.dq[0], log.time - log.time[0]
        names = [(name, sysid.SignalType.MjSensor) for name in JOINTS]
        measured = sysid.TimeSeries.from_names(time_, log.q, self.arm, names)
        commands = sysid.TimeSeries.from_control_names(time_, log.command, self.arm)
        state = sysid.create_initial_state(self.arm, log.q[0], speed)
        return sysid.SystemTrajectory(self.arm, commands, measured, state, None)

    def model(self, unknowns: sysid.ParameterDict) -> mujoco.MjModel:
        """The arm with servos of some values."""
        K, D, J, Fc, L = (np.exp(unknowns[name].value) for name in LOGARITHMS)
        arm = copy.copy(self.arm)
        arm.actuator_gainprm[:, 0], arm.actuator_biasprm[:, 1], arm.dof_damping[:] = K, -K, D
        arm.dof_armature[:], arm.dof_frictionloss[:], arm.actuator_forcerange[:] = J, Fc, np.column_stack([-L, L])
        return arm

    def rollout(
        self, control_signal: Sequence[Any], param_dicts: Sequence[sysid.ParameterDict], **others: Any
    ) -> Sequence[sysid.SystemTrajectory]:
        """What the toolbox simulates, with the commands late and offset as each of the variants has it."""
        late = []
        for commands, unknowns in zip(control_signal, param_dicts, strict=True):
            columns = zip(commands.data.T, unknowns["d"].value, unknowns["b"].value, strict=True)
            data = np.column_stack([np.interp(commands.times - d, commands.times, u) - b for u, d, b in columns])
            late.append(sysid.TimeSeries(commands.times, data, commands.signal_mapping))
        return sysid.sysid_rollout(control_signal=late, **others)

    def residuals(self, x: Array, unknowns: sysid.ParameterDict) -> tuple[list[Array], None, None]:
        """Of all logs."""
        return [self.simulated(x, unknowns, trajectory)[0] for trajectory in self.trajectories], None, None

    def simulated(self, x: Array, unknowns: sysid.ParameterDict, trajectory: sysid.SystemTrajectory) -> Any:
        """Residuals of one log, simulated and measured positions."""
        return sysid.model_residual(
            x, unknowns, self.model, trajectory, self.transform.apply, self.rollout, n_threads=1
        )

    def fit(self, rounds: int) -> None:
        """Some rounds of Levenberg and Marquardt more."""
        self.unknowns, _ = sysid.optimize(
            self.unknowns, self.residuals, verbose=False, max_iters=rounds, eps=DIFFERENCE, x_scale="jac"
        )

    def errors(self, log: Log) -> Array:
        """Root mean square of each joint on a log [rad]."""
        trajectory = self.trajectory(log)
        residuals = self.simulated(self.unknowns.as_vector(), self.unknowns, trajectory)[0]
        return np.sqrt(np.mean(residuals.reshape(-1, N) ** 2, axis=0))


def simulated_logs(seed: int) -> tuple[list[Log], dict[str, Log]]:
    """Training and unseen logs of one simulated arm, as coverage.py has them."""
    rng = np.random.default_rng(seed)
    truth = random_truth(rng, N)
    arm = plant(Path(str(distribution("example-robot-data").locate_file(URDF))), JOINTS, truth)
    logs = [play(arm, JOINTS, truth, motion(rng, N, duration, MIDDLE), str(seed)) for duration in (DURATION, UNSEEN)]
    return logs[:1], {f"seed {seed}": logs[1]}


def real_logs(folder: Path) -> tuple[list[Log], dict[str, Log]]:
    """Training and unseen logs of the real arm."""
    logs = {name: log_of(folder / name, ROBOT, None, ()) for name in (*TRAINING, *UNSEEN_LOGS)}
    return [logs.pop(name) for name in TRAINING], logs


def compared(training: list[Log], unseen: dict[str, Log], budgets: Sequence[int], step: float) -> list[dict[str, Any]]:
    """Errors on unseen logs after each budget of the rival, and here."""
    began = time.process_time()
    result = identify_servos(ROBOT, training)
    cpu, runs = time.process_time() - began, []
    for name, log in unseen.items():
        left = predict_motion(result, servo_motion(log, ROBOT)) - log.q
        runs.append({"unseen": name, "by": "excite", "cpu": cpu, "error": np.sqrt(np.mean(left**2, axis=0)).tolist()})
    began = time.process_time()
    rival, taken, spent = Rival(training, step), 0, time.process_time() - began
    for rounds in budgets:
        began = time.process_time()
        rival.fit(rounds - taken)
        spent, taken = spent + time.process_time() - began, rounds
        by = f"mujoco.sysid, {rounds} rounds"
        runs += [
            {"unseen": n, "by": by, "cpu": spent, "error": rival.errors(each).tolist()} for n, each in unseen.items()
        ]
    return sorted(runs, key=lambda run: list(unseen).index(run["unseen"]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--real", type=Path, metavar="FOLDER")
    parser.add_argument("--seeds", default="200-202", metavar="FIRST-LAST")
    parser.add_argument("--rounds", default="3,10,20", metavar="N,N,...")
    parser.add_argument("--step", type=float, default=0.004, help="of the rival's simulation [s]")
    settings, before, runs = parser.parse_args(), record.load(), []
    first, last = map(int, settings.seeds.split("-"))
    budgets = [int(each) for each in settings.rounds.split(",")]
    sets = [simulated_logs(seed) for seed in range(first, last + 1)]
    if settings.real:
        sys.argv[sys.argv.index(str(settings.real))] = "FOLDER"  # in the command that the results state
        sets.append(real_logs(settings.real))
    for logs in sets:
        runs += compared(*logs, budgets, settings.step)
        print(runs[-1], flush=True)
    rows = [
        [run["unseen"], run["by"], f"{run['cpu']:.0f}", *(f"{1e3 * e:.1f}" for e in (*run["error"], _mean(run)))]
        for run in runs
    ]
    table = record.table(["unseen log", "by", "CPU s", *JOINTS, "mean of the arm"], rows)
    text = f"Errors of the motion predicted from the commands alone, root mean square [mrad]:\n\n{table}"
    record.save("servo_rivals", before, {"runs": runs}, text, LIMITATIONS)


def _mean(run: dict[str, Any]) -> float:
    """Mean over the joints before the gripper."""
    return float(np.mean(run["error"][: N - 1]))


LIMITATIONS = (
    "mujoco.sysid 4.0.1 with its own optimiser, scaled by its Jacobian, from one start in the middle of what the "
    "simulated servos are drawn from; from other starts, or with other steps, it ends elsewhere. CPU seconds add up "
    "over the budgets.",
    "The simulated plant is MuJoCo, so that its model is exactly the rival's, and not exactly the one here; each seed "
    "is one arm and one log, and its errors move by some tenths of a mrad with the log.",
    "The rival fits no Stribeck friction, friction by load, or dead band, which position actuators of MuJoCo lack, and "
    "squares of residuals, so that contacts count fully.",
    "BAM (Rhoban), the other tool for servos, could not be compared: `pip download better-actuator-models` finds no "
    "distribution.",
)


if __name__ == "__main__":
    main()

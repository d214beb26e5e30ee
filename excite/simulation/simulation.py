"""What a robot would do and measure while it follows a motion, with the true values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from excite.logs.log import Log
from excite.registry import built_in
from excite.simulation.integration import SimulatedRun
from excite.simulation.outcome import SimulationOutcome
from excite.simulation.settings import SimulationSettings
from excite.simulation.source import MotionSource
from excite.simulation.steps import Steps
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples


@dataclass(frozen=True)
class TorqueUse:
    """How far one limited torque was used.

    Parameters
    ----------
    label : str
        Such as ``drive z2``.
    peak, limit : float
        Largest magnitude asked for, and allowed [Nm or N].
    saturated : int
        Number of samples at which more was asked for than is allowed.
    """

    label: str
    peak: float
    limit: float
    saturated: int


@dataclass(frozen=True, eq=False, repr=False)
class Simulation:
    """A simulated run.

    Parameters
    ----------
    robot : Robot
        The moving robot, with the load that it held.
    settings : SimulationSettings
    steps : Steps
        How finely it was integrated.
    reference : Samples
        The motion that was wanted, at the log's instants.
    run : SimulatedRun
        What really happened.
    log : Log
        What the joints' sensors say.
    wrench_log : Log or None
        What the force/torque sensor says, with the positions of all joints at its own instants.
    truth : mapping of str to float
        Standard parameters of the moving robot's bodies and drives, and the load's own, where the simulation had
        them; friction that is no Coulomb and viscous friction is not among them.
    torques : tuple of TorqueUse
    outcome : SimulationOutcome
        Whether torques saturated, joints lost the motion, or limits were passed.
    notes : tuple of str
        What was assumed.
    source : MotionSource, optional
        What was played, where it is from a design or a plan.
    """

    robot: Robot
    settings: SimulationSettings
    steps: Steps
    reference: Samples
    run: SimulatedRun
    log: Log
    wrench_log: Log | None
    truth: Mapping[str, float]
    torques: tuple[TorqueUse, ...]
    outcome: SimulationOutcome
    notes: tuple[str, ...]
    source: MotionSource | None = None

    @property
    def measured(self) -> Log:
        """What goes into an identification: the log of the wrench where the motion is for a load, else the joints'."""
        of_load = self.source is not None and self.source.task.model.channel == "wrench"
        return self.wrench_log if of_load and self.wrench_log is not None else self.log

    def __repr__(self) -> str:
        """One line."""
        error = float(np.abs(self.tracking_error).max())
        return f"<Simulation of {self.robot.name}: {self.log.count} instants, tracking within {error:.2g} rad or m>"

    def save(self, log: str | Path, *, replace: bool = False) -> list[Path]:
        """Write the log, and what is true beside it; with a load, the wrench's log too.

        Parameters
        ----------
        log : path
            Ends in .csv.
        replace : bool
            Replace what is there.

        Returns
        -------
        list of Path
            What was written.

        Raises
        ------
        InputError
            Another ending, or files that are there already.
        """
        files: list[Path] = built_in("writer", "simulation")(self, log, replace=replace)
        return files

    @property
    def tracking_error(self) -> Array:
        """``q - q_d`` at the log's instants, shape (N, n) [rad or m]."""
        return np.asarray(self.run.samples.q - self.reference.q)

    @property
    def energy_residual(self) -> float:
        """Largest ``|work - change of energy - friction losses|`` over the run [J]."""
        run = self.run
        return float(np.abs(run.work - (run.energy - run.energy[0]) - run.loss).max())

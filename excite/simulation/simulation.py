"""Result of a simulation: motion, logs and true values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from excite.logs.log import Log
from excite.registry import built_in
from excite.simulation.integration import SimulatedRun
from excite.simulation.outcome import SimulationOutcome
from excite.simulation.plant import Plant
from excite.simulation.reference import MotionSource
from excite.simulation.settings import SimulationSettings
from excite.simulation.steps import Steps
from regressors.friction.curves import CoulombViscous
from regressors.friction.load_share import moving_drive_numbers
from regressors.models.columns import COULOMB, OFFSET, ROTOR, VISCOUS
from regressors.models.differential import DifferentialModel
from regressors.models.drives import drive_column
from regressors.models.nominal import standard_values
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples


@dataclass(frozen=True)
class TorqueUse:
    """Use of one torque limit.

    Parameters
    ----------
    label : str
        Name, such as ``drive z2``.
    peak, limit : float
        Largest commanded magnitude, and the limit [Nm or N].
    saturated : int
        Number of samples at which the command exceeded the limit.
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
        The moving robot, with its load.
    settings : SimulationSettings
    steps : Steps
        Steps of the integration.
    reference : Samples
        The desired motion, at the log's instants.
    run : SimulatedRun
        The true motion.
    log : Log
        Log of the joints' sensors.
    wrench_log : Log or None
        Log of the force/torque sensor, with the positions of all joints at its own instants.
    truth : mapping of str to float
        Standard parameters of the moving robot's bodies and drives, and of the load, as simulated; of friction, only
        Coulomb and viscous parameters are included.
    torques : tuple of TorqueUse
    outcome : SimulationOutcome
        Whether torques saturated, joints lost the motion, or limits were passed.
    notes : tuple of str
        Assumptions of the simulation.
    source : MotionSource, optional
        Source of the motion, where it is from a design or a plan.
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
        """Log for the identification: that of the wrench where the motion is for a load, else that of the joints."""
        of_load = self.source is not None and self.source.task.model.channel == "wrench"
        return self.wrench_log if of_load and self.wrench_log is not None else self.log

    def __repr__(self) -> str:
        """One-line summary."""
        error = float(np.abs(self.tracking_error).max())
        return f"<Simulation of {self.robot.name}: {self.log.count} instants, tracking within {error:.2g} rad or m>"

    def save(self, log: str | Path, *, replace: bool = False) -> list[Path]:
        """Write the log, and the true values to a sidecar; with a load, the wrench's log too.

        Parameters
        ----------
        log : path
            Ends in .csv.
        replace : bool
            Replace existing files.

        Returns
        -------
        list of Path
            Files that were written.

        Raises
        ------
        InputError
            Another ending, or files that exist already.
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


def true_parameters(plant: Plant) -> dict[str, float]:
    """Standard parameters of the simulated robot, by the names of the differential model."""
    columns = DifferentialModel(plant.robot).standard_columns
    names, rotors = {c.name for c in columns}, (c.name for c in columns if c.kind == ROTOR)
    known = {name: value for name, value in standard_values(plant.robot).items() if name in names}
    known |= dict(zip(rotors, plant.rotors.tolist(), strict=True))
    for drive, number in moving_drive_numbers(plant.robot).items():
        curve = plant.friction.curve(drive)
        coulomb, viscous, offset = (drive_column(number, kind).name for kind in (COULOMB, VISCOUS, OFFSET))
        known.pop(coulomb, None)
        known.pop(viscous, None)
        if curve is None:
            curve = CoulombViscous()
        if isinstance(curve, CoulombViscous):
            known |= {coulomb: curve.coulomb, viscous: curve.viscous, offset: curve.offset}
    return known

"""True parameters of a simulation, for comparison with an identification."""

from __future__ import annotations

from excite.simulation.plant import Plant
from regressors.friction.curves import CoulombViscous
from regressors.models.columns import COULOMB, OFFSET, ROTOR, VISCOUS
from regressors.models.differential import DifferentialModel
from regressors.models.drives import drive_column
from regressors.models.nominal import standard_values
from regressors.robot.robot import Robot


def true_parameters(plant: Plant) -> dict[str, float]:
    """Standard parameters of the simulated robot, by the names of the differential model."""
    columns = DifferentialModel(plant.robot).standard_columns
    names, rotors = {c.name for c in columns}, (c.name for c in columns if c.kind == ROTOR)
    known = {name: value for name, value in standard_values(plant.robot).items() if name in names}
    known |= dict(zip(rotors, plant.rotors.tolist(), strict=True))
    for drive, number in _drive_numbers(plant.robot).items():
        curve = plant.friction.curve(drive)
        coulomb, viscous, offset = (drive_column(number, kind).name for kind in (COULOMB, VISCOUS, OFFSET))
        known.pop(coulomb, None)
        known.pop(viscous, None)
        if curve is None:
            curve = CoulombViscous()
        if isinstance(curve, CoulombViscous):
            known |= {coulomb: curve.coulomb, viscous: curve.viscous, offset: curve.offset}
    return known


def _drive_numbers(robot: Robot) -> dict[str, int]:
    """Number in parameter names of every moving drive."""
    if robot.transmission is None:
        return dict(zip(robot.joint_names, robot.link_numbers, strict=True))
    return {drive.name: k for k, drive in enumerate(robot.transmission.drives, 1) if not drive.rests}

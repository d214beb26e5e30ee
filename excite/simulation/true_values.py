"""True parameters of a simulation, for comparison with an identification."""

from __future__ import annotations

from excite.simulation.plant import Plant
from regressors.friction.curves import CoulombViscous
from regressors.friction.friction_drives import moving_drive_numbers
from regressors.models.columns import COULOMB, OFFSET, ROTOR, VISCOUS
from regressors.models.differential import DifferentialModel
from regressors.models.drives import drive_column
from regressors.models.nominal import standard_values


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

"""What identification should find: the parameters that a simulation had."""

from __future__ import annotations

from excite.simulation.plant import Plant
from regressors.friction.curves import CoulombViscous
from regressors.models.differential import DifferentialModel
from regressors.models.nominal import standard_values
from regressors.robot.robot import Robot


def true_parameters(plant: Plant) -> dict[str, float]:
    """Standard parameters that the simulation had, by the names of the differential model."""
    _, names = DifferentialModel(plant.robot).definition()
    known = {name: value for name, value in standard_values(plant.robot).items() if name in names}
    known |= dict(zip((name for name in names if name.startswith("Ia")), plant.rotors.tolist(), strict=True))
    for name, number in _drive_numbers(plant.robot).items():
        curve = plant.friction.curve(name)
        known.pop(f"F{number}c", None)
        known.pop(f"F{number}v", None)
        if curve is None:
            curve = CoulombViscous()
        if isinstance(curve, CoulombViscous):
            known |= {f"F{number}c": curve.coulomb, f"F{number}v": curve.viscous, f"F{number}o": curve.offset}
    return known


def _drive_numbers(robot: Robot) -> dict[str, int]:
    """Number in parameter names of every drive that turns."""
    if robot.transmission is None:
        return dict(zip(robot.joint_names, robot.link_numbers, strict=True))
    return {drive.name: k for k, drive in enumerate(robot.transmission.drives, 1) if not drive.rests}

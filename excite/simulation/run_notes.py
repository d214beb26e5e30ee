"""Notes on a simulated run."""

from __future__ import annotations

from collections.abc import Iterable

from excite.simulation.payload import Payload
from excite.simulation.plant import Plant
from excite.simulation.ramps import GivenTorque, broken_loose
from excite.simulation.settings import SimulationSettings
from excite.simulation.steps import Steps
from regressors.friction.curves import drives_with_friction
from regressors.samples import Samples


def run_notes(plant: Plant, steps: Steps, samples: Samples, load: Payload | None) -> list[str]:
    """Notes on the sign change of friction, extrapolation, and the load."""
    notes = []
    if plant.friction.curves:
        notes.append(_steps_note(steps))
    notes += plant.friction.speed_notes(plant.robot, samples.dq)
    if load is not None:
        notes.append("the standard parameters of its link include the load; those of the load alone are listed too")
    return notes


def _steps_note(steps: Steps) -> str:
    """Note on the sign change of friction."""
    if steps.sticking is None:
        why = ", widened to suit the substep" if steps.widened else ""
        return f"friction changes sign within {steps.width:.3g} rad/s (m/s) of drive velocity{why}"
    why = ", widened to suit the substep" if steps.widened else ""
    return f"friction is presliding: it changes direction over {steps.sticking.distance:.3g} rad (m) of a drive{why}"


def ramp_notes(plant: Plant, samples: Samples, settings: SimulationSettings, ramps: GivenTorque | None) -> list[str]:
    """Note on the torque ramps that broke the drive loose."""
    if ramps is None:
        return []
    row = dict(drives_with_friction(plant.robot))[ramps.drive]
    loose = broken_loose(ramps.delayed(0.0), samples.time, samples.q @ row, settings.catch)
    return [
        f"{ramps.drive} was given {ramps.count} ramps of torque, each until it moves by {settings.catch:g} rad (m); "
        f"it moved in {sum(loose)} of them"
    ]


def impact_notes(settings: SimulationSettings) -> list[str]:
    """Note on each impact."""
    return [
        f"an impact of up to {one.torque:g} Nm (N) acts on {one.joint} from {one.time:g} s on for {one.duration:g} s"
        for one in settings.impact
    ]


def sensor_notes(settings: SimulationSettings) -> list[str]:
    """Note on each error of the torques and steps of the positions."""
    notes = []
    if settings.friction_drift:
        notes.append(f"friction changes by {100 * settings.friction_drift:+g} % from the first instant to the last")
    if any(gain != 1 for gain in settings.torque_gain):
        notes.append(f"measured torques are {_listed(settings.torque_gain)} times the true ones")
    if any(settings.coloured_noise):
        notes.append(
            f"torques have noise of {_listed(settings.coloured_noise)} Nm (N) below {settings.noise_corner:g} Hz"
        )
    if any(settings.position_step):
        notes.append(f"positions are in steps of {_listed(settings.position_step)} rad (m)")
    return notes


def _listed(values: Iterable[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)

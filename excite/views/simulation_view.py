"""What is shown of a simulated log: how well the motion was followed, and the torques that it took."""

from __future__ import annotations

import numpy as np

from excite.simulation.simulation import Simulation
from excite.views.view import UNIT, View, ViewTable, numbers, percents, some_of, texts

_NEGLIGIBLE = 1e-4  # tracking error over the range of motion


def simulation_view(simulation: Simulation) -> View:
    """View of a simulation."""
    samples, settings, outcome, run = (simulation.run.samples, simulation.settings, simulation.outcome, simulation.run)
    what = f"{samples.time[-1]:g} s of {simulation.robot.name}"
    kept = f"Simulated {what}: the motion was followed{_followed(simulation)}"
    return View(
        kind="simulation",
        title=f"simulation of {simulation.robot.name}",
        verdict=kept
        if outcome.holds
        else f"Simulated {what}, but the motion does not hold: {some_of(outcome.failures)}",
        holds=outcome.holds,
        summary=(
            f"{samples.time.size} samples at {settings.rate:g} Hz; {settings.controller} of {settings.bandwidth:g} Hz, "
            f"seed {settings.seed}",
            f"energy: the torques did {run.work[-1]:.4g} J of work, friction took {run.loss[-1]:.4g} J; the balance "
            f"closes to {simulation.energy_residual:.2g} J",
        ),
        remarks=(*(f"does not hold: {each}" for each in outcome.failures), *outcome.notes, *simulation.notes),
        tables=(_torques(simulation), _tracking(simulation)),
    )


def _followed(simulation: Simulation) -> str:
    tracking = simulation.outcome.tracking
    if not tracking:
        return ""
    worst = max(tracking, key=lambda each: each.relative)
    if worst.relative < _NEGLIGIBLE:
        return f" within {100 * _NEGLIGIBLE:g} % of its range of motion"
    deviation = f"{worst.joint}: {worst.error:.2g} {worst.unit}"
    return f" within {100 * worst.relative:.2g} % of its range of motion ({deviation})"


def _torques(simulation: Simulation) -> ViewTable:
    columns = (
        *texts("torque limit of", brief=True),
        *numbers("peak", "limit", brief=True, digits=4),
        *percents("used", brief=True),
        *numbers("samples at the limit", brief=True),
    )
    uses = sorted(simulation.torques, key=lambda use: -use.peak / use.limit)
    rows = tuple((use.label, use.peak, use.limit, use.peak / use.limit, use.saturated) for use in uses)
    return ViewTable("torques", "Commanded torques", columns, rows, most=7)


def _tracking(simulation: Simulation) -> ViewTable:
    columns = (*texts("joint"), *numbers("largest", "rms"), UNIT)
    errors = zip(simulation.robot.joints, simulation.tracking_error.T, strict=True)
    rows = tuple(
        (joint.name, float(np.abs(error).max()), float(np.sqrt(np.mean(error**2))), joint.unit)
        for joint, error in errors
    )
    return ViewTable("tracking", "Tracking error", columns, rows)

"""What is shown of a simulated log: whether the motion was followed, torques, the energy balance."""

from __future__ import annotations

from excite.simulation.simulation import SimulatedLog, Simulation
from excite.views.view import View, ViewTable, headed
from regressors.errors import listed_names, percent

_NEGLIGIBLE = 1e-4  # tracking error over the range of motion


def simulation_view(simulation: Simulation | SimulatedLog) -> View:
    """View of a simulation, or of what was written of one."""
    log = simulation.record if isinstance(simulation, Simulation) else simulation
    what, settings = f"{log.duration:g} s of {log.robot}", log.settings
    lost = f"the motion does not hold: {listed_names(log.failures, 3)}"
    kept = f"the motion was followed{_followed(log)}"
    return View(
        kind="simulation",
        title=f"simulation of {log.robot}",
        verdict=f"Simulated {what}: {kept}" if log.holds else f"Simulated {what}, but {lost}",
        holds=log.holds,
        summary=(
            f"{log.samples} samples at {settings['rate']:g} Hz; {settings['controller']} of {settings['bandwidth']:g} "
            f"Hz, seed {log.seed}",
            f"energy: the torques did {log.work:.4g} J of work, friction took {log.loss:.4g} J; the balance closes to "
            f"{log.energy_residual:.2g} J",
        ),
        remarks=(*(f"does not hold: {each}" for each in log.failures), *log.notes),
        tables=(_torques(log), _tracking(log)),
        facts={"robot": log.robot, "robot_sha256": log.sha256},
    )


def _followed(log: SimulatedLog) -> str:
    if not log.tracking:
        return ""
    worst = max(log.tracking, key=lambda each: each.relative)
    if worst.relative < _NEGLIGIBLE:
        return f" within {100 * _NEGLIGIBLE:g} % of its range of motion"
    deviation = f"{worst.joint}: {worst.error:.2g} {worst.unit}"
    return f" within {percent(worst.relative)} of its range of motion ({deviation})"


def _torques(log: SimulatedLog) -> ViewTable:
    columns = headed("*torque limit of:text, *peak:4, *limit:4, *used:%, *samples at the limit")
    uses = sorted(log.torques, key=lambda use: -use.peak / use.limit)
    rows = tuple((use.label, use.peak, use.limit, use.peak / use.limit, use.saturated) for use in uses)
    return ViewTable("torques", "Commanded torques", columns, rows, most=7)


def _tracking(log: SimulatedLog) -> ViewTable:
    rows = tuple((each.joint, each.error, each.rms, each.unit) for each in log.tracking)
    return ViewTable("tracking", "Tracking error", headed("joint:text, largest, rms, unit:unit"), rows)

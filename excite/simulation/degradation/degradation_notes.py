"""What was done to a simulated log, in words."""

from __future__ import annotations

from collections.abc import Iterable

from excite.simulation.degradation.degradation import Degradation


def degradation_notes(degradation: Degradation) -> tuple[str, ...]:
    """One sentence for each degradation."""
    return (*_of_torques(degradation), *_of_rows(degradation))


def _of_torques(said: Degradation) -> list[str]:
    notes = []
    if said.friction_drift:
        notes.append(f"friction changes by {100 * said.friction_drift:+g} % from the first instant to the last")
    if any(gain != 1 for gain in said.torque_gain):
        notes.append(f"measured torques are {_listed(said.torque_gain)} times the true ones")
    if any(said.delay):
        notes.append(f"torques are recorded {_listed(1000 * late for late in said.delay)} ms later than positions")
    if any(said.coloured_noise):
        notes.append(f"torques have noise of {_listed(said.coloured_noise)} Nm (N) below {said.noise_corner:g} Hz")
    return notes


def _of_rows(said: Degradation) -> list[str]:
    notes = []
    if any(said.position_step):
        notes.append(f"positions are in steps of {_listed(said.position_step)} rad (m)")
    if said.hold:
        notes.append(f"{100 * said.hold:g} % of the rows repeat the row before under a new stamp")
    if said.clock_jitter is not None:
        shortest, longest = (1000 * between for between in said.clock_jitter)
        notes.append(f"rows are stamped late, from {shortest:g} to {longest:g} ms apart")
    if said.drop_rows:
        notes.append(f"{100 * said.drop_rows:g} % of the rows are missing")
    return notes


def _listed(values: Iterable[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)

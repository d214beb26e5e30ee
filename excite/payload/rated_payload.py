"""Largest payloads of the built-in robots, as their makers state them."""

from __future__ import annotations

RATED = {
    "irp6": 6.0,  # [KD96]
    "irp6-full": 6.0,
    "iiwa7": 7.0,  # KUKA, "LBR iiwa 7 R800" data sheet
    "panda": 3.0,  # Franka Emika, "Panda" data sheet
    "ur10e": 12.5,  # Universal Robots, "UR10e" data sheet
}
"""By the name of the robot [kg]."""


def rated_payload(name: str) -> float | None:
    """Largest payload of a robot; None where it is not known."""
    return RATED.get(name)

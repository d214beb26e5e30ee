"""Time that a campaign takes, predicted before its selections of drives are tried."""

from __future__ import annotations

_NUMBER = 1.1e-6  # seconds of a triangular factor for each pair of columns and each equation


def campaign_seconds(selections: float, columns: int, equations: int) -> float:
    """Time of the factors of all selections of drives on one core [s]; right within a factor of three.

    The unit that it grows with is a number of these factors: selections times equations times columns times columns.
    Measured with 21 to 127 selections, 13 to 84 columns and 1 to 7 equations.
    """
    return 0.1 + _NUMBER * selections * equations * float(columns) ** 2

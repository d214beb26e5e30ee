"""What the stated intervals hold for: one log, or the robot across several."""

from __future__ import annotations

TYPICAL, FRICTION = 1.6, 3.2  # largest scatter between two logs of a real robot over stated deviations, benchmarks/real


def interval_scope(logs: int) -> str:
    """Describe what the intervals of a result hold for."""
    if logs == 1:
        return (
            "the intervals are for this log: they state what its noise does, not what changes from log to log. On the "
            f"real robots measured, estimates from different logs scattered up to {TYPICAL:g} times as much as such "
            f"intervals state, coefficients of friction up to {FRICTION:g} times; identify from several logs to have "
            "that included"
        )
    return f"the intervals hold across logs such as these {logs}: the scatter between them is included"

"""How much of a log's motion is simulated: all of a short one, windows spread evenly over a long one."""

from __future__ import annotations

from excite.simulation.replay import Replay

WHOLE = 60.0  # logs of up to this are simulated as a whole [s]
SAMPLE = 30.0  # of longer ones at most so much, in windows [s]
_MOST, _FEWEST = 60, 10  # windows, however short or long they are
_ROUNDING = 1e-9


def most_windows(duration: float, horizon: float) -> int | None:
    """Windows of a motion that are simulated at most; None for all of them.

    The error of a joint's simulated motion is a root mean square over windows. Of 60 of them, chance changes it by
    about a tenth, while it is judged against a tolerance of about a quarter of the travel.
    """
    if duration <= WHOLE * (1 + _ROUNDING):
        return None
    return min(_MOST, max(_FEWEST, round(SAMPLE / horizon)))


def sampling_remark(replay: Replay, horizon: float) -> str | None:
    """Which windows were simulated, in words; None where all of them were."""
    if not replay.left_out:
        return None
    count = len(replay.starts)
    total = count + replay.left_out
    return (
        f"simulated motion: {count} of {total} windows of {horizon:.3g} s, spread evenly over the log; "
        "torques are predicted in all of its rows"
    )

"""Time that a verification takes, predicted once its log is read."""

from __future__ import annotations

from excite.logs.log import Log
from excite.verification.simulated_windows import SAMPLE, WHOLE

_REPLAYS = 4.0  # from one to a dozen: the horizon is shortened until it can tell a good model from a bad one
_ONE, _ROW = 3e-3, 3.6e-7  # seconds of a simulated motion for each joint to the third power, and of each row of it
_EQUATIONS = 5e-7  # seconds of the predicted torques for each row and pair of joints


def verification_seconds(log: Log, *, simulated: bool) -> float:
    """Time of a verification on one core, without figures [s]; right within a factor of four.

    The unit that it grows with is one evaluation of the equations of motion, whose instructions grow with the third
    power of the joints; there are about sixteen of them to a row. Measured with 1000 to 20,000 rows of 6 and 7 joints;
    robots with parallel axes take less, and a light wrist, for which the motion restarts often, takes more. Of a log
    longer than `WHOLE`, no more than `SAMPLE` is simulated.
    """
    joints, duration = len(log.joints), float(log.time[-1] - log.time[0])
    seconds = 0.1 + _EQUATIONS * log.count * joints**2
    rows = log.count if duration <= WHOLE else log.count * SAMPLE / duration
    return float(seconds + simulated * _REPLAYS * (_ONE + _ROW * rows) * joints**3)

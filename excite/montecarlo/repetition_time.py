"""Time that the repetitions of an experiment take, predicted before the first one."""

from __future__ import annotations

from excite.montecarlo.experiment import Experiment

_EACH = 2e-3  # seconds of a repetition, however short
_PLAIN, _WHOLE = 3e-8, 8e-8  # seconds of a row and pair of joints; of windows, or with a low-pass


def repetition_seconds(experiment: Experiment, count: int) -> float:
    """Time of some repetitions on one core [s]; right within a factor of three.

    The unit that it grows with is a number of the regressor: rows times joints times joints. Measured with 300 to
    20,000 rows of 3 to 7 joints; fewer than 8000 rows with a low-pass took up to five times as long.
    """
    joints, rows = experiment.model.robot.n, experiment.samples.time.size
    whole = experiment.model.window is not None or experiment.low_pass is not None
    return float(count * (_EACH + (_WHOLE if whole else _PLAIN) * rows * joints**2))

"""Warning where the logs do not determine the torques of other motions."""

from __future__ import annotations

from excite.identification.plausibility.doubt import Doubt
from excite.identification.plausibility.expected_error import ExpectedError

LARGEST = 0.10  # of the torque: the tolerance of a verdict, which the next log then exceeds by noise alone
_USEFUL = 0.8  # of the error: a designed motion that does not gain more is not proposed


def few_data(logs: int, expected: ExpectedError, method: str, excess: float = 0.0) -> Doubt | None:
    """Warning where predictions on other motions are expected to fail by the noise of the logs alone, or did fail."""
    if not max(expected.logs, excess) > LARGEST:
        return None
    what, noise = ("this log is", "its noise") if logs == 1 else (f"these {logs} logs are", "their noise")
    kept = (
        "what the estimate has beyond comes from the condition that bodies are real"
        if method == "physical"
        else "errors of the model come on top"
    )
    if excess > expected.logs:
        return Doubt(
            f"{what} too little",
            f"blocks of time that were left out are predicted by least squares with errors of {100 * excess:.2g} % of "
            f"the torque beyond those of the rows identified from, and {kept}",
            _cure(expected, method),
        )
    return Doubt(
        f"{what} too little",
        f"{noise} alone leaves errors of about {100 * expected.logs:.2g} % of the torque on other motions of the same "
        f"ranges and speeds, and {kept}",
        _cure(expected, method),
    )


def _cure(expected: ExpectedError, method: str) -> str:
    physical = "" if method == "physical" else ", or admit only parameters of real bodies with `estimator='physical'`"
    gain = expected.designed
    if gain is None or gain > _USEFUL * expected.logs:
        return f"add a log of another motion{physical}"
    return (
        f"the noise of a designed motion of the same length, ranges and speeds leaves about {100 * gain:.2g} %, that "
        f"of this one {100 * expected.logs:.2g} % (`design_trajectory`); or add a log of another motion{physical}"
    )

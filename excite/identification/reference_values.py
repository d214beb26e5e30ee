"""What an estimate is compared with: the truth of simulated logs, or the robot's description."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from excite.files.result_json import Reference
from excite.identification.identification import Identification
from excite.logs.sidecar import sidecar_of
from regressors.models.nominal import parameter_values, standard_values


def reference_of(result: Identification, paths: Sequence[Path]) -> Reference:
    """True values of simulated logs, else those of the robot's description.

    Parameters
    ----------
    result : Identification
    paths : sequence of Path
        Its logs.

    Raises
    ------
    InputError
        The file beside a log is of another robot.
    """
    beside = [sidecar_of(path, result.robot) for path in paths]
    truths = [content.get("truth") for content in beside if content is not None]
    model, base = result.subject.model, result.subject.base
    if len(truths) == len(paths) and truths[0] and all(truth == truths[0] for truth in truths):
        return Reference("truth", parameter_values(model, base, truths[0]))
    return Reference("description", parameter_values(model, base, standard_values(result.subject.robot)))

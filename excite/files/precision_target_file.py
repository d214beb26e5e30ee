"""Files of a precision target, as YAML: the entries of `excite.PrecisionTarget`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from excite.files.sampled_motion import RATES, read_table
from excite.tasks.precision_target import TaskMotion
from regressors.errors import InputError
from regressors.input_files import read_text
from regressors.readers.documents import parse_document
from regressors.samples import Samples


def read_precision_target(path: Path) -> dict[str, Any]:
    """Read a file such as ``share: 0.05`` and ``parameters: {X5: 0.1}``.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        Cannot be read, or malformed (with the line).
    """
    try:
        text = read_text(path)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"precision: expected a share such as 5%, or a file, and cannot read {path}: "
            f"{getattr(error, 'strerror', None) or error}"
        ) from error
    document = parse_document(text, str(path))
    assert isinstance(document.content, dict)
    content = {str(name): value for name, value in document.content.items()}
    if isinstance(content.get("torques"), dict):
        content["torques"] = _task_motion(content["torques"], path)
    return content


def _task_motion(entry: dict[str, Any], path: Path) -> Any:
    """The task motion of ``torques: {motion: FILE, share: 0.05}``; a folder stands for its trajectory.csv."""
    if set(entry) != {"motion", "share"}:
        raise InputError(f"{path}: torques: expected `motion`, a file, and `share`; given {', '.join(map(str, entry))}")
    file = path.parent / str(entry["motion"])
    file = file / "trajectory.csv" if file.is_dir() else file
    header, table, _ = read_table(file, RATES)
    column = {name: table[:, k] for k, name in enumerate(header)}
    joints = [name.removesuffix(".position") for name in header if name.endswith(".position")]
    missing = [f"{joint}.{rate}" for joint in joints for rate in RATES if f"{joint}.{rate}" not in column]
    if not joints or missing or "time" not in column:
        raise InputError(
            f"{file}: expected columns time, NAME.position, NAME.velocity and NAME.acceleration of every joint; "
            f"given {', '.join(header) or 'none of them'}"
        )
    q, dq, ddq = (np.column_stack([column[f"{joint}.{rate}"] for joint in joints]) for rate in RATES)
    return TaskMotion.of(Samples(column["time"], q, dq, ddq, np.zeros_like(q)), joints, entry["share"])

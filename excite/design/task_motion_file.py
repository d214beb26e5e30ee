"""Task motions from files, that of a design's folder or a table as ``trajectory.csv``, and precision targets."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from excite.design.design_json import load_design
from excite.design.formulation import INSTANTS, task_motion_of
from excite.storage.sampled_motion import read_table
from excite.tasks.stored_files import TaskMotion
from regressors.errors import InputError
from regressors.input_files import read_text
from regressors.readers.documents import parse_document

_COLUMNS = ("position", "velocity", "acceleration")


def read_task_motion(place: str | Path) -> TaskMotion:
    """Read the motion whose torques a design is to predict."""
    path = Path(place)
    if path.suffix != ".csv":
        return task_motion_of(load_design(path))
    header, table, _ = read_table(path, _COLUMNS)
    joints = [name.removesuffix(".position") for name in header if name.endswith(".position")]
    wanted = [[f"{joint}.{what}" for joint in joints] for what in _COLUMNS]
    missing = [name for names in wanted for name in names if name not in header]
    if not joints or missing or not len(table):
        lacking = ", ".join(missing[:3]) or ("rows" if joints else "columns NAME.position of joints")
        raise InputError(f"task_motion {path}: {lacking} missing; expected the columns of trajectory.csv")
    rows = np.unique(np.linspace(0, len(table) - 1, min(INSTANTS, len(table))).round().astype(int))
    q, dq, ddq = (table[rows][:, [header.index(name) for name in names]] for names in wanted)
    return TaskMotion(str(place), tuple(joints), q, dq, ddq)


def read_precision_target(path: Path) -> dict[str, Any]:
    """Read a file such as ``share: 0.05`` and ``parameters: {X5: 0.1}``."""
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
    if isinstance(entry := content.get("torques"), dict):  # ``torques: {motion: FILE, share: 0.05}``
        if set(entry) != {"motion", "share"}:
            given = ", ".join(map(str, entry))
            raise InputError(f"{path}: torques: expected `motion`, a file, and `share`; given {given}")
        content["torques"] = {
            "share": entry["share"],
            "motion": read_task_motion(path.parent / str(entry["motion"])),  # a folder or a table beside the file
        }
    return content

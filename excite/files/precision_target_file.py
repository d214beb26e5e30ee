"""Files of a precision target, as YAML: the entries of `excite.PrecisionTarget`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from excite.files.task_motion_file import read_task_motion
from regressors.errors import InputError
from regressors.input_files import read_text
from regressors.readers.documents import parse_document


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
    if isinstance(content.get("torques"), dict):
        content["torques"] = _task_torques(content["torques"], path)
    return content


def _task_torques(entry: dict[str, Any], path: Path) -> dict[str, Any]:
    """Content of ``torques: {motion: FILE, share: 0.05}``; the motion is a folder or a table beside the file."""
    if set(entry) != {"motion", "share"}:
        raise InputError(f"{path}: torques: expected `motion`, a file, and `share`; given {', '.join(map(str, entry))}")
    return {"share": entry["share"], "motion": read_task_motion(path.parent / str(entry["motion"]))}

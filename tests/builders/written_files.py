"""Files and folders that tests write."""

from __future__ import annotations

from dataclasses import asdict, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from regressors.robot.robot import Robot


def text_file(path: Path, text: str) -> Path:
    """The file, which holds the text."""
    path.write_text(text, encoding="utf-8")
    return path


def saved(folder: Path, result: Any, **options: Any) -> Path:
    """The folder that a result is saved to."""
    result.save(folder, **options)
    return folder


def assert_alike(one: Any, other: Any, *left_out: str) -> None:
    """Fields of two records are the same to the last bit, those of robots by their hash; nan is nan."""
    for field in fields(one):
        ours, theirs = (getattr(record, field.name) for record in (one, other))
        if isinstance(ours, Robot):
            ours, theirs = ours.sha256(), theirs.sha256()
        elif is_dataclass(ours):
            ours, theirs = asdict(ours), asdict(theirs)
        if field.name not in left_out:
            np.testing.assert_equal(theirs, ours, field.name)

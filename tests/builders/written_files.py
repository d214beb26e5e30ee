"""Files and folders that tests write."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def text_file(path: Path, text: str) -> Path:
    """The file, which holds the text."""
    path.write_text(text, encoding="utf-8")
    return path


def saved(folder: Path, result: Any, **options: Any) -> Path:
    """The folder that a result is saved to."""
    result.save(folder, **options)
    return folder

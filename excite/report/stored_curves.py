"""The file of curves beside a result, where the folder has it; else a sentence on what stands in for it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from excite.storage.curves_file import Arrays
from excite.storage.manifest import check_files, read_manifest


def stored_curves(folder: Path, kind: str, name: str, read: Callable[[Path], Arrays]) -> tuple[Arrays | None, str]:
    """Curves that a result was written with; None, and why, where there are none."""
    entry = read_manifest(folder).get(kind)
    if entry is None or name not in entry.files or not (folder / name).is_file():
        return None, (
            f"figures of the logs are the pictures in the folder, and the motion does not play: there is no {name}, "
            "which is written since this version"
        )
    check_files(folder, kind, [each for each in entry.files if each.endswith(".json")] + [name])
    arrays = read(folder / name)
    step = int(arrays["every"]) if "every" in arrays else 1
    if step == 1:
        return arrays, ""
    return arrays, f"figures of the logs show every {step}th instant; the tables are of all of them"

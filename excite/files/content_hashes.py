"""Hashes in ``design.json`` by which an edited motion is found: of its coefficients, and of the files that play it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from excite.storage.manifest import entry_sha256, sha256_of
from regressors.errors import InputError

HASHES = "sha256"


def motion_hashes(trajectory: Mapping[str, Any], files: Iterable[Path]) -> dict[str, Any]:
    """Entry ``sha256`` of a design: hashes of its coefficients and of the files of its motion."""
    return {"trajectory": entry_sha256(trajectory), "files": {file.name: sha256_of(file) for file in files}}


def check_motion(content: Mapping[str, Any], folder: Path) -> None:
    """Check that the motion of a stored design, and its files that are beside it, are those that were written.

    A design of a version without hashes is taken as it is.
    """
    hashes = content.get(HASHES)
    if hashes is None:
        return
    if entry_sha256(content["trajectory"]) != hashes["trajectory"]:
        raise InputError(
            "the coefficients of the motion (entry 'trajectory') were changed after the design was written: their "
            "SHA-256 is not the one in the entry 'sha256'; restore the file, or design the motion again"
        )
    for name, expected in hashes["files"].items():
        if name == Path(name).name and sha256_of(folder / name) not in (None, expected):
            raise InputError(
                f"{name} beside it was changed after the design was written: its SHA-256 is not the one in the entry "
                "'sha256'; restore the file, or design the motion again; to play a motion of your own, move it to "
                "another folder and name it with `trajectory`"
            )

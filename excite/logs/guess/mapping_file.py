"""The mapping of a guess, written to a file."""

from __future__ import annotations

from pathlib import Path

from excite.logs.guess.log_guess import LogGuess
from excite.logs.guess.mapping_text import mapping_text
from excite.storage.atomic import replacing
from excite.storage.result_file import replace_files, result_file
from regressors.errors import InputError


def check_mapping_free(path: Path, *, replace: bool) -> None:
    """Refuse to write a mapping where a file is, unless it is to be replaced."""
    if path.is_dir():
        raise InputError(f"{path} is a folder; give the name of a file for the mapping")
    if path.exists() and not replace:
        raise InputError(f"{path} exists; give another name, or `replace=True`")


def write_mapping_file(guess: LogGuess, path: str | Path, *, replace: bool = False) -> None:
    """Write the mapping of a guess, with what is known and what is asked as comments."""
    text = mapping_text(guess)
    path = Path(path)
    if not path.name:
        raise InputError("the name of the mapping to write is empty")
    with result_file(path):
        check_mapping_free(path, replace=replace)
        with replace_files(path) as staged, replacing(staged / path.name) as stream:
            stream.write(text)

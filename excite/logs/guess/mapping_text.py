"""The mapping of a guess as YAML, with comments, and its file."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from excite.logs.guess.log_guess import LogGuess
from excite.storage.atomic import replacing
from excite.storage.result_folder import replace_files, result_file
from regressors.errors import InputError
from regressors.quoting import printable

_WIDTH = 110
_DEFAULTS: dict[str, object] = {"separator": ",", "header": True, "skip": 0}
_SECTIONS = ("position", "velocity", "effort", "current", "temperature", "wrench")


def mapping_text(guess: LogGuess) -> str:
    """Text of the mapping file of a guess."""
    if guess.mapping is None:
        raise InputError(f"{guess.contents.source}: no mapping can be written; {guess.questions[0]}")
    content = guess.mapping.model_dump(exclude_unset=True)
    lines = [
        *_comment(f"Mapping of {guess.contents.source} ({guess.contents.format}), to be corrected."),
        *_comment("Give it as the mapping of the log once the lines with QUESTION are answered."),
        *(line for text in guess.remarks.get("", ()) for line in _comment(text)),
    ]
    for name, default in _DEFAULTS.items():
        if name in content and content[name] != default:
            lines.append(f"{name}: {_value(content[name])}")
    if content.get("joints"):
        lines.append(f"joints: {_value(content['joints'])}")
    lines += ["", *_remarks(guess, "time"), f"time: {_value(content['time'])}"]
    for name in _SECTIONS:
        if name in content:
            lines += ["", *_remarks(guess, name), f"{name}:"]
            lines += [f"  {key}: {_value(_single(key, value))}" for key, value in content[name].items()]
    for name in (name for name in _SECTIONS if name not in content and guess.remarks.get(name)):
        lines += ["", *_remarks(guess, name)]
    return "\n".join(lines) + "\n"


def _remarks(guess: LogGuess, part: str) -> Iterator[str]:
    for text in guess.remarks.get(part, ()):
        yield from _comment(text)


def _comment(text: str) -> Iterator[str]:
    line = "#"
    for word in printable(text).split():
        if len(line) + len(word) + 1 > _WIDTH and line != "#":
            yield line
            line = "#  "
        line += f" {word}"
    yield line


def _single(key: str, value: Any) -> Any:
    """One value for all, where a field has only one."""
    one = key in ("unit", "sign", "offset") and isinstance(value, list) and len(value) == 1
    return value[0] if one else value


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_value(each)}" for key, each in value.items()) + "}"
    if isinstance(value, str) and value.replace("/", "").isalnum() and not value[:1].isdigit():
        return value if value not in _WORDS else json.dumps(value)
    if isinstance(value, Sequence) and not isinstance(value, str):
        return "[" + ", ".join(_value(each) for each in value) + "]"
    return json.dumps(value, ensure_ascii=not (isinstance(value, str) and value.isprintable()))


_WORDS = frozenset({"true", "false", "null", "yes", "no", "on", "off", "y", "n", "True", "False", "Null", "nan", "inf"})


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

"""What was asked: the options of a task that are not the defaults, in words, and as a task file."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Collection, Mapping
from typing import Any

from excite.report.sections import text_of
from excite.tasks.option import options_of
from excite.tasks.task import PARTS

_LIMITS = "limits"
_BESIDE = ("executor", "workers")  # change nothing in the result
_LONG = 200  # characters


def asked(task: Mapping[str, Any], always: Collection[str]) -> tuple[tuple[str, str], ...]:
    """Some options of a task, and every other one that is not the default, as names and texts."""
    changed = {name: value for name, value in _flat(task).items() if name in always or not _is_default(name, value)}
    return tuple((name.replace("_", " "), _cut(text_of(value))) for name, value in changed.items())


def task_file(task: Mapping[str, Any]) -> str:
    """The same task as the text of a task file, an option per line; JSON is YAML."""
    limits = {name: value for name, value in (task.get(_LIMITS) or {}).items() if value is not None}
    plain = {name: value for name, value in task.items() if value is not None and name != _LIMITS}
    options = {**plain, **({_LIMITS: limits} if limits else {})}
    lines = (f"{json.dumps(name)}: {json.dumps(value, ensure_ascii=False)}" for name, value in options.items())
    return "{\n  " + ",\n  ".join(lines) + "\n}\n"


def _flat(task: Mapping[str, Any]) -> dict[str, Any]:
    limits = {f"{name}_limit": value for name, value in (task.get(_LIMITS) or {}).items()}
    return {**{name: value for name, value in task.items() if name not in (_LIMITS, *_BESIDE)}, **limits}


def _is_default(name: str, value: Any) -> bool:
    if name == "snap_angles":
        return bool(value)
    known = _defaults().get(name)
    return value is None or value == known or (isinstance(value, list) and tuple(value) == known)


def _defaults() -> dict[str, Any]:
    fields = [(field, part) for part in PARTS.values() for field, _ in options_of(part)]
    return {field.name: field.default if field.default is not dataclasses.MISSING else None for field, _ in fields}


def _cut(text: str) -> str:
    return text if len(text) <= _LONG else f"{text[: _LONG - 1]}\N{HORIZONTAL ELLIPSIS}"

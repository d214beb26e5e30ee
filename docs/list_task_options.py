"""List every option of a task as a Markdown table: ``python docs/list_task_options.py --out docs/task_options.md``."""

from __future__ import annotations

import argparse
from pathlib import Path

from excite.cli.task_options import flag_of
from excite.registry import ADDRESS_FORMS, BUILT_IN
from excite.tasks.limit_choice import OF_JOINTS
from excite.tasks.option import Option, options_of
from excite.tasks.task import PARTS
from excite.tasks.values import EXPECTED

HEAD = """# Options of a task

Each option is a field of one of the seven parts of `excite.Task`, an option of `excite design`, and a key of a task
file.
Limits of joints stand below `limits` in a task file. Where a name is expected, `module:Name` names a part of your own.
"""


def table(part: str) -> str:
    """Options of one part."""
    rows = ["| option | on the command line | value | default | meaning |", "|---|---|---|---|---|"]
    for field, option in options_of(PARTS[part]):
        key = f"limits: {field.name}" if field.name in OF_JOINTS and part == "limits" else field.name
        meaning = option.help.split("  [default")[0].replace("; see below", "").rstrip(".")
        rows.append(
            f"| `{key}` | {flag(field.name, option)} | {values(option)} | {default(field.default)} | {meaning} |"
        )
    return f"## `{PARTS[part].__name__}` (`task.{part}`)\n\n" + "\n".join(rows) + "\n"


def flag(name: str, option: Option) -> str:
    """Option on the command line, if it is there."""
    return "" if option.hidden else f"`{flag_of(name, option)}`"


def values(option: Option) -> str:
    """What an option takes."""
    names = option.choices or ((*BUILT_IN[option.part], *ADDRESS_FORMS.get(option.part, ())) if option.part else ())
    return ", ".join(f"`{name}`" for name in names) if names else EXPECTED[option.kind].replace("|", "or")


def default(value: object) -> str:
    """A default as it is typed."""
    if value is None or value == ():
        return ""
    if isinstance(value, tuple):
        return f"`{', '.join(map(str, value))}`"
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


def text() -> str:
    """The whole page."""
    return "\n".join([HEAD, *map(table, PARTS)])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="List every option of a task as a Markdown table.")
    parser.add_argument("--out", type=Path, required=True)
    parser.parse_args().out.write_text(text(), encoding="utf-8")

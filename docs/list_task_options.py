"""List every option of every kind of settings: ``python docs/list_task_options.py --out docs/task_options.md``."""

from __future__ import annotations

import argparse
from pathlib import Path

from excite.cli.options import flag_of
from excite.design.friction_runs.schedule import Schedule
from excite.friction.constant_speed_windows import FitSettings
from excite.identification.recipe import Recipe
from excite.registry import ADDRESS_FORMS, BUILT_IN
from excite.simulation.settings import SimulationSettings
from excite.tasks.further_settings import (
    BoundSettings,
    CalibrationSettings,
    CampaignSettings,
    EnsembleSettings,
    Extents,
    FrictionPoses,
    GainSettings,
    LoadFrame,
    MotionSettings,
    PayloadMotionSettings,
    PayloadSettings,
    RepeatSettings,
    StudySettings,
    Tolerances,
    UnloadedRows,
)
from excite.tasks.limit_choice import OF_JOINTS
from excite.tasks.option import EXPECTED, Option, options_of
from excite.tasks.task import PARTS

OTHERS = {
    SimulationSettings: "excite simulate",
    MotionSettings: "excite simulate",
    BoundSettings: "excite bound",
    Recipe: "excite identify",
    Tolerances: "excite verify",
    Schedule: "excite friction plan",
    FitSettings: "excite friction fit",
    FrictionPoses: "excite friction plan",
    CampaignSettings: "excite plan",
    GainSettings: "excite identify",
    RepeatSettings: "excite identify",
    StudySettings: "excite study",
    Extents: "excite predict, excite verify",
    EnsembleSettings: "excite export",
    PayloadMotionSettings: "excite payload design",
    LoadFrame: "excite payload design, excite payload identify",
    PayloadSettings: "excite payload identify",
    CalibrationSettings: "excite payload gains",
    UnloadedRows: "excite payload gains, excite payload identify",
}

HEAD = """# Options of a task

Each option is a field of one of the seven parts of `excite.Task`, an option of `excite design`, and a key of a task
file. Those of other commands follow: fields of the settings, or arguments, that the Python functions take.
`excite COMMAND --help-all` lists every option of a command, and each can be given as `--set NAME=VALUE` too.
Limits of joints stand below `limits` in a task file. Where a name is expected, `module:Name` names a part of your own.
"""


def table(settings: type, where: str) -> str:
    """Options of one kind of settings."""
    rows = ["| option | on the command line | value | default | meaning |", "|---|---|---|---|---|"]
    for field, option in options_of(settings):
        key = f"limits: {field.name}" if field.name in OF_JOINTS and settings is PARTS["limits"] else field.name
        meaning = option.described(field.name).replace("; see below", "").rstrip(".").replace("|", "or")
        cells = (f"`{key}`", flag(field.name, option), values(option), default(field.default, option), meaning)
        rows.append(f"| {' | '.join(cells)} |")
    return f"## `{settings.__name__}` (`{where}`)\n\n" + "\n".join(rows) + "\n"


def flag(name: str, option: Option) -> str:
    """Option on the command line, if it is there."""
    return "" if option.hidden else f"`{flag_of(name, option)}`"


def values(option: Option) -> str:
    """What an option takes."""
    names = option.choices or ((*BUILT_IN[option.part], *ADDRESS_FORMS.get(option.part, ())) if option.part else ())
    return ", ".join(f"`{name}`" for name in names) if names else EXPECTED[option.kind].replace("|", "or")


def default(value: object, option: Option) -> str:
    """A default as it is typed."""
    if option.unset is not None:
        return option.unset
    if value is None or value == ():
        return ""
    if isinstance(value, tuple):
        return f"`{', '.join(map(str, value))}`"
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


def text() -> str:
    """The whole page."""
    parts = [table(settings, f"task.{part}") for part, settings in PARTS.items()]
    return "\n".join([HEAD, *parts, *(table(settings, command) for settings, command in OTHERS.items())])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="List every option of a task as a Markdown table.")
    parser.add_argument("--out", type=Path, required=True)
    parser.parse_args().out.write_text(text(), encoding="utf-8")

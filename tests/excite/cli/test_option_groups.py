"""Options of each command in groups of `--help`, those of a design by the parts of a task."""

from __future__ import annotations

import click
import pytest
from all_commands import COMMANDS
from click.testing import CliRunner

from excite.cli.command import Command
from excite.cli.main import cli
from excite.cli.option_groups import heading_of
from excite.tasks.task import PLACE

PARTS = {
    "installation": "Robot",
    "model": "Model",
    "trajectory": "Motion",
    "objective": "Criterion",
    "limits": "Limits",
    "search": "Search",
    "output": "Home and rehearsal",
}
OF_DESIGN = [*PARTS.values(), "Output", "Other"]


def shown(name: str) -> dict[str, list[str]]:
    """Options by heading, as the help prints them."""
    text = CliRunner().invoke(cli, [*name.split(), "--help"]).output
    found: dict[str, list[str]] = {}
    heading = ""
    for line in text.partition("Examples:")[0].partition("Example:")[0].splitlines():
        if line.endswith(":") and not line.startswith(" "):
            heading = line[:-1]
        if line.startswith("  -"):
            found.setdefault(heading, []).append(line.split()[0].rstrip(","))
    return found


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_is_below_one_heading(name: str) -> None:
    command = COMMANDS[name]
    assert isinstance(command, Command)
    ctx = click.Context(command)
    visible = [p for p in command.get_params(ctx) if isinstance(p, click.Option) and not p.hidden]
    found = shown(name)
    assert "Options" not in found
    printed = sorted(option for options in found.values() for option in options)
    assert printed == sorted(param.opts[0] for param in visible)


@pytest.mark.parametrize("name", COMMANDS)
def test_headings_of_a_command_name_options_that_it_has(name: str) -> None:
    command = COMMANDS[name]
    assert isinstance(command, Command)
    stated = [option for options in command.groups.values() for option in options]
    assert set(stated) <= {param.name for param in command.params}
    assert len(stated) == len(set(stated))


def test_options_of_a_design_are_grouped_by_the_parts_of_a_task() -> None:
    found = shown("design")
    assert list(found) == OF_DESIGN
    assert max(map(len, found.values())) < 25
    for param in COMMANDS["design"].params:
        if param.name in PLACE and param.name not in ("rate", "world") and not getattr(param, "hidden", False):
            assert param.opts[0] in found[PARTS[PLACE[str(param.name)]]]


def test_what_nothing_is_known_of_is_about_the_output() -> None:
    assert heading_of("of_tomorrow", {}) == "Output"
    command = Command("some", params=[click.Option(["--of-tomorrow"])])
    assert "Output:\n  --of-tomorrow TEXT" in command.get_help(click.Context(command))


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_the_shared_options(name: str) -> None:
    options = {option for param in COMMANDS[name].params for option in param.opts}
    assert {"-q", "--quiet", "-v", "--verbose", "--json"} <= options
    hidden = [param for param in COMMANDS[name].params if "--format" in param.opts and getattr(param, "hidden", False)]
    assert len(hidden) == (name != "export")  # whose --format is that of the file

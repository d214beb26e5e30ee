"""Help of each command in groups, and completion by the shell."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.shell_completion import BashComplete, FishComplete, ZshComplete
from click.testing import CliRunner
from commands import COMMANDS

from excite.cli.command import LINES, FurtherOption
from excite.cli.main import _GROUPS, cli
from excite.registry import BUILT_IN
from excite.tasks.task import PLACE
from regressors.readers.library import built_in_names

# Options of each command: in groups of `--help-all`, the essential ones in `--help`.


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
    text = CliRunner().invoke(cli, [*name.split(), "--help-all"]).output
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
    ctx = click.Context(command, **command.context_settings)
    visible = [p for p in command.get_params(ctx) if isinstance(p, click.Option) and not p.hidden]
    found = shown(name)
    assert "Options" not in found
    printed = sorted(option for options in found.values() for option in options)
    assert printed == sorted(param.opts[0] for param in visible)
    stated = [option for options in command.groups.values() for option in options]
    assert set(stated) <= {param.name for param in command.params}
    assert len(stated) == len(set(stated))
    assert {"-q", "--quiet", "-v", "--verbose", "--json"} <= {option for p in command.params for option in p.opts}


@pytest.mark.parametrize("columns", [80, 100, 200])
@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_fits_a_screen(name: str, columns: int) -> None:
    runner = CliRunner(env={"COLUMNS": str(columns)})
    lines = runner.invoke(cli, [*name.split(), "--help"]).output.splitlines()
    assert sum(1 + max(0, len(line) - 1) // columns for line in lines) <= LINES
    end = next((k for k, line in enumerate(lines) if line.strip() in ("Examples:", "Example:")), None)
    options = [line.split()[0].rstrip(",") for line in lines[:end] if line.startswith("  -")]
    assert 4 <= len(options) <= 25
    command = COMMANDS[name]
    visible = command.visible_options(click.Context(command, **command.context_settings))
    assert sorted(options) == sorted(each.opts[0] for each in visible if not isinstance(each, FurtherOption))
    assert lines[-1] == f"All {len(visible)} options: cli {name} --help-all"


def test_options_of_a_design_are_grouped_by_the_parts_of_a_task() -> None:
    found = shown("design")
    assert list(found) == OF_DESIGN
    assert max(map(len, found.values())) < 25
    for param in COMMANDS["design"].params:
        if param.name in PLACE and param.name not in ("rate", "world") and not getattr(param, "hidden", False):
            assert param.opts[0] in found[PARTS[PLACE[str(param.name)]]]


def test_every_command_is_below_one_heading_in_their_order() -> None:
    below = [name for names in _GROUPS.values() for name in names]
    assert sorted(below) == sorted(cli.list_commands(click.Context(cli)))
    text = CliRunner().invoke(cli, ["--help"]).output
    places = [text.index(f"\n{heading}:") for heading in _GROUPS]
    assert places == sorted(places)
    assert all(f"\n  {name} " in text for name in below)


# Completion by the shell, as click's protocol asks for it.


CASES = {
    "excite de": {"design"},
    "excite friction ": {"plan", "fit"},
    "excite friction fi": {"fit"},
    "excite design irp": {"irp6", "irp6-full", "irp"},  # the last: files
    "excite design irp6 --model ": set(BUILT_IN["model"]),
    "excite design irp6 --criterion s": {"sigma-min"},
    "excite plan irp6 --model e": {"energy"},
    "excite export d --format ur": {"urscript", "urdf"},
    "excite identify irp6 run.csv --estimator p": {"physical"},
    "excite logs run.csv --robot pa": {"panda", "pa"},
    "excite design irp6 --torque-m": {"--torque-margin"},
    "excite payload identify --contr": {"--controller"},
}


SHELLS = {"bash": BashComplete, "zsh": ZshComplete, "fish": FishComplete}


def completed(line: str, shell: str = "bash") -> str:
    """What a shell gets for a line whose last word is being typed."""
    _, *words, typed = line.split(" ")
    complete = SHELLS[shell](cli, {}, "excite", "_EXCITE_COMPLETE")
    return "\n".join(map(complete.format_completion, complete.get_completions(words, typed)))


def test_names_are_completed() -> None:
    found = {line: {one.partition(",")[2] for one in completed(line).splitlines()} for line in CASES}
    assert found == CASES
    for shell in SHELLS:
        assert all(name in completed("excite robots ", shell) for name in built_in_names())


def test_completing_imports_only_the_command_and_nothing_heavy(tmp_path: Path) -> None:
    program = (
        "import sys\n"
        "from excite.cli.main import main\n"
        "sys.argv = ['excite']\n"
        "try:\n    main()\nfinally:\n    print(*sys.modules, file=sys.stderr)\n"
    )
    asked = {"COMP_WORDS": "excite de", "COMP_CWORD": "1", "_EXCITE_COMPLETE": "bash_complete"}
    ended = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        env={**os.environ, **asked},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.stdout == "plain,design\n"
    modules = set(ended.stderr.split())
    assert not {"numpy", "casadi", "rich", "excite.cli.design_commands"} & modules

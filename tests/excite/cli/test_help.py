"""Help of each command in groups, every option by --set too, and completion by the shell."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click
import pytest
from click.shell_completion import BashComplete, FishComplete, ZshComplete
from click.testing import CliRunner
from commands import COMMANDS, ENVIRONMENT, run_process

from excite.cli.command import LINES, FurtherOption
from excite.cli.main import _GROUPS, cli
from excite.registry import BUILT_IN
from excite.tasks.task import PLACE
from regressors.readers.library import built_in_names

# Options of each command: in groups of `--help-all`, the essential ones in `--help`, each by `--set` too.


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
    hidden = [param for param in command.params if "--format" in param.opts and getattr(param, "hidden", False)]
    assert len(hidden) == (name != "export")  # whose --format is that of the file


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
    assert lines[-1] == f"All {len(visible)} options: cli {name} --help-all; set any by --set NAME=VALUE"


def test_options_of_a_design_are_grouped_by_the_parts_of_a_task() -> None:
    found = shown("design")
    assert list(found) == OF_DESIGN
    assert max(map(len, found.values())) < 25
    for param in COMMANDS["design"].params:
        if param.name in PLACE and param.name not in ("rate", "world") and not getattr(param, "hidden", False):
            assert param.opts[0] in found[PARTS[PLACE[str(param.name)]]]


def given(words: str, name: str = "design") -> dict[str, Any]:
    """Parameters of a command line that is read, not run."""
    command = COMMANDS[name]
    params: dict[str, Any] = command.make_context("excite", words.split()).params
    return params


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_can_be_set_by_its_name_and_its_key(name: str) -> None:
    command = COMMANDS[name]
    ctx = click.Context(command, **command.context_settings)
    left_out = ("set_options", "help_all", command.get_help_option(ctx).name)  # type: ignore[union-attr]
    for option in command.visible_options(ctx):
        if option.name in left_out:
            continue
        for key in {option.opts[-1].removeprefix("--"), option.opts[-1].removeprefix("--").replace("-", "_")}:
            (word,) = command._set_words(ctx, ["--set", f"{key}=true"])
            assert word == option.opts[-1] + ("" if option.is_flag else "=true")


def test_what_is_set_is_what_is_typed() -> None:
    typed = given("irp6 --out d --period 8 --velocity-limit 2,1 --no-friction --drives 1,2 --via 0,1 --via 1,0")
    settings = ("period=8", "velocity=2,1", "friction=false", "drives=1,2", "via=0,1", "via=1,0")
    assert given(f"irp6 --out d {' '.join(f'--set {each}' for each in settings)}") == typed
    assert given("irp6 --set out=d --set velocity-limit=2,1 --set period=8 --no-friction --set no-friction=yes "
                 "--drives 1,2 --via 0,1 --via 1,0") == typed  # fmt: skip
    assert given("irp6 --out d --period 8 --set period=8.0")["period"] == 8.0
    assert given("irp6 --out d --constraint torque --set constraint=torque")["constraints"] == ("torque",)


UNSET = {
    "--set perod=8": "--set: no option named 'perod'; did you mean period",
    "--set period": "--set: expected NAME=VALUE, given 'period'",
    "--set period=8 --period 9": "--period is given twice, with different values; give one",
    "--set period=8 --set period=9": "--period is given twice, with different values; give one",
    "--set friction=false --friction": "--friction is given twice, with different values; give one",
    "--set xacro=false": "--set: xacro can only be switched on; leave it out",
    "--set torque-margin=7": "Invalid value for '--torque-margin': must be a number from 0 to 0.999, given 7",
    "--set weighted=perhaps": "Invalid value for '--weighted': 'perhaps' is not a valid boolean",
}


def test_what_cannot_be_set_is_an_error_of_one_line() -> None:
    for words, message in UNSET.items():
        with pytest.raises(click.UsageError) as caught:
            given(f"irp6 --out d {words}")
        assert caught.value.format_message().startswith(message)
        assert "\n" not in caught.value.format_message()


def test_help_wins_over_wrong_settings() -> None:
    for word in ("--help", "--help-all", "-h"):
        ended = CliRunner().invoke(cli, ["design", "--set", "perod=8", word])
        assert (ended.exit_code, ended.output[:6]) == (0, "Usage:")


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
    ended = run_process([sys.executable, "-c", program], tmp_path, {**ENVIRONMENT, **asked})
    assert ended.stdout == "plain,design\n"
    modules = set(ended.stderr.split())
    assert not {"numpy", "casadi", "rich", "excite.cli.design_commands"} & modules

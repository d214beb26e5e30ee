"""The help of the command line: every command below one heading, in the order of the list."""

import click
import pytest
from click.testing import CliRunner

from excite.cli.main import _GROUPS, cli


def test_every_command_is_below_one_heading() -> None:
    below = [name for names in _GROUPS.values() for name in names]
    assert sorted(below) == sorted(cli.list_commands(click.Context(cli)))


def test_the_help_has_the_headings_and_the_commands() -> None:
    text = CliRunner().invoke(cli, ["--help"]).output
    places = [text.index(f"\n{heading}:") for heading in _GROUPS]
    assert places == sorted(places)
    for names in _GROUPS.values():
        assert all(f"\n  {name} " in text for name in names)


def test_a_former_name_still_works_with_a_note(capsys: pytest.CaptureFixture[str]) -> None:
    context = click.Context(cli)
    name, command, rest = cli.resolve_command(context, ["campaign", "run", "x.yaml"])
    assert (name, rest) == ("sweep", ["run", "x.yaml"])
    assert command is cli.get_command(context, "sweep")
    assert capsys.readouterr().err == "excite: note: 'excite campaign' is now 'excite sweep'\n"
    assert "campaign" not in cli.list_commands(context)

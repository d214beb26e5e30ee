"""The help of the command line: every command below one heading, in the order of the list."""

import click
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

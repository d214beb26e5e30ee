"""Every command of the command line, by the words that run it."""

from __future__ import annotations

from collections.abc import Iterator

import click

from excite.cli.main import cli


def commands(group: click.Command = cli, words: tuple[str, ...] = ()) -> Iterator[tuple[str, click.Command]]:
    """Words and command, for every command that is no group."""
    if not isinstance(group, click.Group):
        yield " ".join(words), group
        return
    ctx = click.Context(group)
    for name in group.list_commands(ctx):
        command = group.get_command(ctx, name)
        assert command is not None
        yield from commands(command, (*words, name))


COMMANDS = dict(commands())

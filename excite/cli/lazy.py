"""A group of commands whose modules are imported only when the command runs."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import click


class LazyGroup(click.Group):
    """Group whose commands are the `command` of one module each.

    Parameters
    ----------
    summaries : mapping of str to str
        One-line help of each command, by name.
    modules : str
        Pattern of their modules, with ``{}`` for the name, such as ``excite.cli.{}_command``.
    **options
        Options of `click.Group`.
    """

    def __init__(self, *, summaries: Mapping[str, str], modules: str, **options: Any) -> None:
        super().__init__(**options)
        self._summaries, self._modules = dict(summaries), modules

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the commands, in the order of the help."""
        return list(self._summaries)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """Return the command of a name, importing its module."""
        if name not in self._summaries:
            return None
        command: click.Command = import_module(self._modules.format(name)).command
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Resolve a command as click does, but list the available names for an unknown one."""
        if args[0] not in self._summaries:
            ctx.fail(f"no command named {args[0]!r}; available: {', '.join(self._summaries)}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands without importing any."""
        with formatter.section("Commands"):
            formatter.write_dl(list(self._summaries.items()))

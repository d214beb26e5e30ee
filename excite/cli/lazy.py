"""A group of commands whose modules are imported only when the command runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from difflib import get_close_matches
from functools import wraps
from typing import Any

import click
from click.shell_completion import CompletionItem

from excite.cli.streams import loudness_options
from excite.registry import import_attribute
from regressors.errors import shortened

CONTEXT = {"help_option_names": ["-h", "--help"], "max_content_width": 110}


def runs(place: str) -> Callable[[Callable[[], None]], Callable[..., Any]]:
    """Decorator of what describes a command, which runs a function that is imported only then."""

    def decorate(described: Callable[[], None]) -> Callable[..., Any]:
        @wraps(described)
        def command(**given: Any) -> Any:
            return import_attribute(f"excite.cli.{place}")(**given)

        return command

    return decorate


class LazyGroup(click.Group):
    """Group whose commands are imported from `places`, ``module:attribute`` by name."""

    def __init__(
        self,
        *,
        summaries: Mapping[str, str],
        places: Mapping[str, str],
        groups: Mapping[str, Sequence[str]] | None = None,
        **options: Any,
    ) -> None:
        super().__init__(**{"context_settings": CONTEXT, **options})
        self._summaries, self._places = dict(summaries), dict(places)
        self._groups = groups or {"Commands": tuple(summaries)}
        self.params += loudness_options()

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the commands, in the order of the help."""
        return list(self._summaries)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """Return the command of a name, importing its module."""
        if name in self.commands or name not in self._summaries:
            return self.commands.get(name)
        command: click.Command = import_attribute(f"excite.cli.{self._places[name]}")
        return command

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Commands that begin so, without importing any; options as click completes them."""
        known = self._summaries.items()
        begun = [CompletionItem(name, help=text) for name, text in known if name.startswith(incomplete)]
        return [*begun, *click.Command.shell_complete(self, ctx, incomplete)]

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Resolve a command as click does, but for an unknown one name what may be meant, and those that there are."""
        if args[0] not in self._summaries:
            near = get_close_matches(args[0], self._summaries, 1)
            meant = f"did you mean {near[0]}? " if near else ""
            ctx.fail(f"no command named {shortened(args[0])}; {meant}available: {', '.join(self._summaries)}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands without importing any."""
        widest = max(map(len, self._summaries))
        for heading, names in self._groups.items():
            with formatter.section(heading):
                formatter.write_dl([(f"{name:<{widest}}", self._summaries[name]) for name in names])

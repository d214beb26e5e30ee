"""``excite friction``: a group of commands, each imported only when it runs."""

from __future__ import annotations

from importlib import import_module

import click

_COMMANDS = {
    "plan": "Design the runs at constant speed that show friction.",
    "fit": "Fit friction curves to logs of runs at constant speed.",
}


class _Lazy(click.Group):
    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in _COMMANDS:
            return None
        made: click.Command = import_module(f"excite.cli.friction_{name}").command
        return made

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args[0] not in _COMMANDS:
            ctx.fail(f"no command named {args[0]!r}; available: {', '.join(_COMMANDS)}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(_COMMANDS.items()))


@click.group(
    name="friction",
    cls=_Lazy,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
def command() -> None:
    """Measure a robot's friction on its own: plan the runs, fit the curves.

    The curves are saved as a file that 'excite identify --friction-curves' and 'excite simulate --friction' take.
    """

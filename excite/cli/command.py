"""A command whose help lists its options in groups, and which has the options that every command has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import click

from excite.cli.option_groups import heading_of, in_order
from excite.cli.verbosity import form_options, loudness_options

_WIDEST = 30  # characters of an option before its text begins on the next line, as click has it


class Command(click.Command):
    """Command with ``--quiet``, ``--verbose`` and ``--json``, whose options are listed below headings."""

    def __init__(self, *args: Any, groups: Mapping[str, Sequence[str]] | None = None, **options: Any) -> None:
        super().__init__(*args, **options)
        self.groups = dict(groups or {})
        taken = {name for param in self.params for name in param.opts}
        self.params += [*form_options(taken), *loudness_options()]

    def grouped_options(self, ctx: click.Context) -> dict[str, list[click.Option]]:
        """Options that the help shows, by heading, in its order."""
        found: dict[str, list[click.Option]] = {}
        for param in self.get_params(ctx):
            if isinstance(param, click.Option) and not param.hidden:
                found.setdefault(heading_of(str(param.name), self.groups), []).append(param)
        return {heading: found[heading] for heading in in_order(found, self.groups)}

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options below their headings, their texts in one column."""
        records = {
            heading: [record for option in options if (record := option.get_help_record(ctx)) is not None]
            for heading, options in self.grouped_options(ctx).items()
        }
        names = [name for rows in records.values() for name, _ in rows]
        column = max((len(name) for name in names if len(name) <= _WIDEST), default=0)
        for heading, rows in records.items():
            with formatter.section(heading):
                formatter.write_dl([(f"{name:<{column}}", text) for name, text in rows], col_max=_WIDEST)

"""How much every command prints, and in which form: ``--quiet``, ``--verbose`` and ``--json``."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import click

from excite.cli.sign_of_life import be_quiet

_KEY = "excite.verbosity"


@dataclass
class Verbosity:
    """What the command line asks to be printed."""

    quiet: bool = False  # only the verdict
    verbose: bool = False  # all tables and notes, times, versions, and the files that are read
    as_json: bool = False  # one JSON document on stdout instead of text
    # when the command line was read, on the clock `time.monotonic` [s]
    began: float = field(default_factory=time.monotonic)

    @property
    def plain(self) -> bool:
        """True if none of the options is given."""
        return not (self.quiet or self.verbose or self.as_json)


def verbosity() -> Verbosity:
    """What the command at work prints."""
    ctx = click.get_current_context(silent=True)
    return Verbosity() if ctx is None else _of(ctx)


def _of(ctx: click.Context) -> Verbosity:
    chosen: Verbosity = ctx.meta.setdefault(_KEY, Verbosity())
    return chosen


def _choose(ctx: click.Context, param: click.Parameter, value: Any) -> None:
    """Note one option; a group's counts for its commands too."""
    chosen, asked = _of(ctx), value == "json" if param.name == "form" else bool(value)
    if not asked:
        return
    setattr(chosen, "as_json" if param.name == "form" else str(param.name), True)
    if chosen.quiet and chosen.verbose:
        raise click.UsageError("--quiet and --verbose exclude each other", ctx)
    if chosen.quiet:
        be_quiet()


def _flag(names: list[str], text: str) -> click.Option:
    return click.Option(names, is_flag=True, default=False, expose_value=False, callback=_choose, help=text)


def loudness_options() -> list[click.Option]:
    """``--quiet`` and ``--verbose``."""
    return [
        _flag(["-q", "--quiet"], "Print only the verdict, and no progress."),
        _flag(["-v", "--verbose"], "Print all tables, notes, times and versions."),
    ]


def form_options(taken: Iterable[str]) -> list[click.Option]:
    """``--json``, and its older spelling ``--format json`` where that name is free."""
    options = [_flag(["--json", "as_json"], "Print the summary as one JSON document.")]
    if "--format" not in taken:
        kinds = click.Choice(["text", "json"])
        options.append(
            click.Option(["--format", "form"], type=kinds, hidden=True, expose_value=False, callback=_choose)
        )
    return options

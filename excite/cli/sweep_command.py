"""``excite sweep``: a group of commands, each imported only when it is run."""

from __future__ import annotations

import click

from excite.cli.lazy import LazyGroup

_COMMANDS = {"run": "Design every cell of a sweep file, or those that are left, and tabulate all."}


@click.group(
    name="sweep",
    cls=LazyGroup,
    summaries=_COMMANDS,
    modules="excite.cli.sweep_{}_command",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
def command() -> None:
    """Design for every combination of robots, models, families, criteria, limits and seeds that a file states.

    'excite plan' is another thing: it proposes which drives to move in which motion.
    """

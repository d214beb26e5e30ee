"""``excite friction``: a group of commands, each imported only when it is run."""

from __future__ import annotations

import click

from excite.cli.lazy import LazyGroup

_COMMANDS = {
    "plan": "Plan runs at constant speed, from which friction is measured.",
    "fit": "Fit friction curves to logs of runs at constant speed.",
}


@click.group(
    name="friction",
    cls=LazyGroup,
    summaries=_COMMANDS,
    modules="excite.cli.friction_{}_command",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)
def command() -> None:
    """Measure a robot's friction on its own: plan the runs, fit the curves.

    The curves are saved as a file that --friction-curves of 'excite design' and 'excite identify' takes, and
    --friction of 'excite simulate'.
    """

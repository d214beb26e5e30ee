"""``excite payload``: a group of commands, each imported only when it is run."""

from __future__ import annotations

import click

from excite.cli.lazy import LazyGroup

_COMMANDS = {
    "design": "Find a short motion in a small box that shows what the robot holds.",
    "gains": "Calibrate the gains of the drives with a load of known mass.",
    "identify": "Estimate mass, centre and inertia of what the robot holds.",
}


@click.group(
    name="payload",
    cls=LazyGroup,
    summaries=_COMMANDS,
    modules="excite.cli.payload_{}_command",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
    epilog="""\b
From an unknown gripper to the numbers of the controller:
  excite payload design ur10e --box 0.2 --period 5 --out motion       the motion; play it without and with the load
  excite payload gains ur10e --without bare.csv --with weight.csv --mass 2.5 --out gains.yaml        once, optional
  excite payload identify ur10e --without bare.csv --with load.csv --gains gains.yaml --out payload  mass, ...""",
)
def command() -> None:
    """Measure what a robot holds: mass, centre and inertia, in seconds, by its own joint torques or a wrist sensor."""
